// Sources: Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course (n = v = r); Walter et
// al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007 (the distribution).

#include "core/environment/ggx_lobe.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/math.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

// With n = v the half vector h bisects n and l, so (n.h)^2 = (1 + c) / 2 for c = n.l, and
//   D(h) c ~ c / (1 - (1 - a) (n.h)^2)^2 = c / (a + q (1 - c))^2,  a = alpha^2, q = (1 - a) / 2,
// in which nothing cancels. The scale is 1 / (2 pi I), I = integral_0^1 c dc / (a + q (1 - c))^2 =
// ((a + q) / a - 1 - ln((a + q) / a)) / q^2, and 1/2 at q = 0; with x = q / a, I is
// (x - ln(1 + x)) / q^2, whose difference cancels for small x and is summed as a series there:
// x - ln(1 + x) = x^2 (1/2 - x/3 + x^2/4 - ...).
GgxLobe::GgxLobe(double alpha) : alpha_(alpha) {
  assert(alpha > 0 && alpha <= 1);
  narrow_ = alpha * alpha;
  broad_ = (1 - narrow_) / 2;
  const double x = broad_ / narrow_;
  double integral = 0;
  if (x < 0.05) {
    double power = 1;
    for (int k = 2; k < 16; ++k, power *= -x) integral += power / k;
    integral /= narrow_ * narrow_;
  } else {
    integral = (x - std::log1p(x)) / (broad_ * broad_);
  }
  scale_ = 1 / (2 * kPi * integral);
}

double GgxLobe::operator()(double cosine) const {
  if (cosine <= 0) return 0;
  const double d = narrow_ + broad_ * std::max(0.0, 1 - cosine);
  return scale_ * cosine / (d * d);
}

double GgxLobe::at_angle(double angle_rad) const {
  if (angle_rad >= kPi / 2) return 0;
  const double s = std::sin(angle_rad / 2);
  const double d = narrow_ + broad_ * 2 * s * s;
  return scale_ * std::cos(angle_rad) / (d * d);
}

// h_l = 2 pi integral_0^{pi/2} lobe(t) P_l(cos t) sin t dt by panels of 16 Gauss points: no wider
// than half the distance to the lobe's nearest complex pole (about max(alpha, t)), nor than 24
// radians of the fastest band.
std::vector<double> ggx_band_responses(const GgxLobe& lobe, int bands) {
  const GaussRule rule = gauss_legendre(16);
  std::vector<double> responses(static_cast<size_t>(bands));
  std::vector<double> grow, keep;
  for (int l = 0; l < bands; ++l) {
    grow.push_back(l > 0 ? (2.0 * l - 1) / l : 0.0);
    keep.push_back(l > 0 ? (l - 1.0) / l : 0.0);
  }
  for (double begin = 0; begin < kPi / 2;) {
    const double widest = std::min(0.5 * std::max(lobe.alpha(), begin), 24.0 / bands);
    const double end = std::min(kPi / 2, begin + widest);
    for (size_t i = 0; i < rule.nodes.size(); ++i) {
      const double angle = begin + (end - begin) * 0.5 * (1 + rule.nodes[i]);
      const double weight =
          2 * kPi * lobe.at_angle(angle) * std::sin(angle) * 0.5 * (end - begin) * rule.weights[i];
      const double z = std::cos(angle);
      double before = 0, value = weight;
      responses[0] += value;
      for (size_t l = 1; l < responses.size(); ++l) {
        const double next = grow[l] * z * value - keep[l] * before;
        before = value;
        value = next;
        responses[l] += value;
      }
    }
    begin = end;
  }
  return responses;
}

}  // namespace lightkiln
