// Source: Davis & Rabinowitz, "Methods of Numerical Integration", 2nd ed., 1984, section 2.7.

#include "core/sphere/quadrature.h"

#include <cassert>
#include <cmath>

#include "core/base/math.h"

namespace lightkiln {

// Newton's method on P_n from Tricomi's guess cos(pi (i + 3/4) / (n + 1/2)); with
// P_n' = n (x P_n - P_{n-1}) / (x^2 - 1) the weight is 2 / ((1 - x^2) P_n'^2).
GaussRule gauss_legendre(int count) {
  assert(count >= 1);
  GaussRule rule;
  rule.nodes.resize(static_cast<size_t>(count));
  rule.weights.resize(static_cast<size_t>(count));
  for (int i = 0; i < (count + 1) / 2; ++i) {
    double x = std::cos(kPi * (i + 0.75) / (count + 0.5));
    double slope = 1;
    for (int step = 0; step < 100; ++step) {
      double before = 1, value = x;
      for (int l = 2; l <= count; ++l) {
        const double next = ((2 * l - 1) * x * value - (l - 1) * before) / l;
        before = value;
        value = next;
      }
      slope = count * (x * value - before) / (x * x - 1);
      const double change = value / slope;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    const bool middle = count % 2 == 1 && i == count / 2;
    if (middle) x = 0;
    const size_t low = static_cast<size_t>(i), high = static_cast<size_t>(count - 1 - i);
    rule.nodes[low] = -x;
    rule.nodes[high] = x;
    rule.weights[low] = rule.weights[high] = 2 / ((1 - x * x) * slope * slope);
  }
  return rule;
}

// The remainder on an interval of length h is h^(2n+1) (n!)^4 / ((2n+1) ((2n)!)^3) f^(2n), with
// f^(2n) = (phase / h)^(2n) for the oscillation; divided by h.
double gauss_phase_error(int count, double phase_rad) {
  const double n = count;
  const double log_error = 2 * n * std::log(phase_rad) + 4 * std::lgamma(n + 1) -
                           std::log(2 * n + 1) - 3 * std::lgamma(2 * n + 1);
  return std::exp(log_error);
}

}  // namespace lightkiln
