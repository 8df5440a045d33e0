#include "core/base/pinned_math.h"

#include <cmath>
#include <cstddef>

#include "core/base/math.h"

namespace lightkiln {

namespace {

// Taylor's series about 0 for |x| <= pi / 4: the first term left out is under 1e-19.
double sine_near(double x) {
  const double q = x * x;
  double sum = 0;
  for (int n = 16; n >= 2; n -= 2) sum = -q * (1 + sum) / (n * (n + 1));
  return x + x * sum;
}
double cosine_near(double x) {
  const double q = x * x;
  double sum = 0;
  for (int n = 17; n >= 1; n -= 2) sum = -q * (1 + sum) / (n * (n + 1));
  return 1 + sum;
}

}  // namespace

// With n the nearest whole number to x / (pi / 2), x - n pi / 2 is taken in two steps: the first
// part of pi / 2 has 33 bits, so that its product with n is exact (Cody and Waite, "Software Manual
// for the Elementary Functions", 1980). Quarter turns swap the two functions and their signs.
SinCos pinned_sin_cos(double angle_rad) {
  constexpr double kHigh = 1.5707963267341256, kLow = 6.077100506506192e-11;
  const double turns = std::floor(angle_rad * (2 / kPi) + 0.5);
  const double rest = (angle_rad - turns * kHigh) - turns * kLow;
  const double sine = sine_near(rest), cosine = cosine_near(rest);
  switch (static_cast<long long>(turns) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

// The smaller coordinate over the larger is t in [0, 1]. With c the nearest eighth,
//   atan t = atan c + atan((t - c) / (1 + t c)),
// and the rest, at most 1/16, by its series, whose first term left out is under 1e-19. Octants
// follow from atan(1 / t) = pi / 2 - atan t and the signs.
double pinned_atan2(double y, double x) {
  static constexpr double kAtanOfEighths[9] = {0.0,
                                               0.12435499454676144,
                                               0.24497866312686414,
                                               0.35877067027057225,
                                               0.4636476090008061,
                                               0.5585993153435624,
                                               0.6435011087932844,
                                               0.7188299996216245,
                                               0.7853981633974483};
  const double ax = std::fabs(x), ay = std::fabs(y);
  const bool steep = ay > ax;
  const double larger = steep ? ay : ax, smaller = steep ? ax : ay;
  if (!(larger > 0)) return 0;
  const double t = smaller / larger;
  const double eighth = std::floor(8 * t + 0.5);
  const double c = eighth / 8;
  const double z = (t - c) / (1 + t * c);
  const double q = z * z;
  double sum = 0;
  for (int n = 13; n >= 3; n -= 2) sum = q * (1.0 / n - sum);
  double angle = kAtanOfEighths[static_cast<size_t>(eighth)] + (z - z * sum);
  if (steep) angle = kPi / 2 - angle;
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

}  // namespace lightkiln
