// Sources: Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course (n = v = r); Walter et
// al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007 (the distribution).

#include "core/environment/ggx_lobe.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/math.h"

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

double GgxLobe::at_angle(double angle_rad) const {
  if (angle_rad >= kPi / 2) return 0;
  const double s = std::sin(angle_rad / 2);
  const double d = narrow_ + broad_ * 2 * s * s;
  return scale_ * std::cos(angle_rad) / (d * d);
}

double GgxLobe::horizon_slope() const {
  const double d = narrow_ + broad_;
  return scale_ / (d * d);
}

// No wider than half the distance to the lobe's nearest complex pole, about max(alpha, t).
double GgxLobe::panel(double angle_rad) const {
  return 0.5 * std::max(alpha_, angle_rad);
}

// 1 / d^2 = integral_0^inf s exp(-s d) ds is a sum of Gaussians in the chord, as d = a + q x. Those
// with s < split are wide, and what remains sums to the core:
//   integral_split^inf s exp(-s d) ds = exp(-split d) (1 + split d) / d^2  (Ewald's device).
// 1 - (1 + z) exp(-z) = z^2/2 - z^3/3 + z^4/8 - ... cancels for small z and is summed there.
double GgxHalo::share(double distance) const {
  const double z = split_ * (lobe_.narrow() + lobe_.broad() * distance);
  if (z >= 0.1) return 1 - (1 + z) * std::exp(-z);
  double sum = 0, term = z * z;  // the series' k-th term is (-1)^k (k - 1) / k! z^k
  for (int k = 2; k < 12; ++k) {
    sum += term * (k - 1);
    term *= -z / (k + 1);
  }
  return 0.5 * sum;
}

double GgxHalo::at_angle(double angle_rad) const {
  const double s = std::sin(angle_rad / 2);
  return share(2 * s * s) * lobe_.at_angle(angle_rad);
}

double GgxHalo::horizon_slope() const {
  return share(1) * lobe_.horizon_slope();
}

double GgxHalo::panel(double angle_rad) const {
  return std::max(0.5 * std::max(lobe_.alpha(), angle_rad), 1 / std::sqrt(split_));
}

std::vector<double> ggx_band_responses(const GgxLobe& lobe, int bands) {
  return band_responses(lobe, bands);
}

}  // namespace lightkiln
