// Sources: Estevez & Kulla, "Production Friendly Microfacet Sheen BRDF", SIGGRAPH 2017 course (the
// distribution); Khronos glTF-IBL-Sampler, lib/source/shaders/filter.frag (n = v = r, n.l weights).

#include "core/environment/charlie_lobe.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/math.h"

namespace lightkiln {

// D(h) = (2 + 1/a) sin(h)^(1/a) / (2 pi). With n = v the half vector bisects n and l, so that
// sin(h)^2 = (1 - c) / 2 for c = n.l; half vectors by D n.h become directions by D / 4, and with
// the weight n.l the lobe is proportional to c (1 - c)^p, p = 1 / (2 a), on 0 < c < 1. Since
// integral_0^1 c (1 - c)^p dc = 1 / ((p + 1) (p + 2)), the scale is (p + 1) (p + 2) / (2 pi).
CharlieLobe::CharlieLobe(double alpha)
    : power_(0.5 / alpha), scale_((power_ + 1) * (power_ + 2) / (2 * kPi)) {
  assert(alpha > 0 && alpha <= 1);
}

double CharlieLobe::operator()(double cosine) const {
  if (cosine <= 0) return 0;
  return scale_ * cosine * std::pow(std::max(0.0, 1 - cosine), power_);
}

double CharlieLobe::at_angle(double angle_rad) const {
  if (angle_rad >= kPi / 2) return 0;
  const double s = std::sin(angle_rad / 2);
  return scale_ * std::cos(angle_rad) * std::pow(2 * s * s, power_);
}

// At the pole the lobe behaves like t^(2p), whose exponent need not be whole: panels double from a
// small one, in which next to nothing lies. Elsewhere it changes over 1 / p of the cosine.
double CharlieLobe::panel(double angle_rad) const {
  return std::min(std::max(1e-3, angle_rad), 4 / (power_ + 4));
}

}  // namespace lightkiln
