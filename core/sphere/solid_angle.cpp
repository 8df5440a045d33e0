#include "core/sphere/solid_angle.h"

#include <cmath>

#include "core/base/math.h"

namespace lightkiln {

namespace {

// The solid angle of the rectangle [0, x] x [0, y] at distance 1: atan(x y / sqrt(x^2 + y^2 + 1)).
double corner_solid_angle(double x, double y) {
  return std::atan2(x * y, std::sqrt(x * x + y * y + 1));
}

}  // namespace

// Four terms in double: on a face of 4096 texels the cancellation leaves 1e-9 of a texel, and the
// terms telescope, so that the faces sum to 4 pi.
double cube_texel_solid_angle(int x, int y, int size) {
  const double x0 = 2.0 * x / size - 1, x1 = 2.0 * (x + 1) / size - 1;
  const double y0 = 2.0 * y / size - 1, y1 = 2.0 * (y + 1) / size - 1;
  return corner_solid_angle(x1, y1) - corner_solid_angle(x0, y1) - corner_solid_angle(x1, y0) +
         corner_solid_angle(x0, y0);
}

// Exact: the row spans colatitudes [t0, t1], and cos t0 - cos t1 = 2 sin((t0+t1)/2) sin((t1-t0)/2),
// which does not cancel at the poles.
double latlong_texel_solid_angle(int y, int width, int height) {
  const double middle = kPi * (y + 0.5) / height;
  return 4 * kPi / width * std::sin(middle) * std::sin(kPi / (2.0 * height));
}

double cap_solid_angle(double half_angle_rad) {
  const double s = std::sin(half_angle_rad / 2);
  return 4 * kPi * s * s;
}

}  // namespace lightkiln
