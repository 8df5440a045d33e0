#include "core/sphere/solid_angle.h"

#include <cmath>

#include "core/base/pinned_math.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

// The solid angle of the rectangle [0, x] x [0, y] at distance 1: atan(x y / sqrt(x^2 + y^2 + 1)).
double corner_solid_angle(double x, double y) {
  return pinned_atan2(x * y, std::sqrt(x * x + y * y + 1));
}

}  // namespace

// Four terms in double: on a face of 4096 texels the cancellation leaves 1e-9 of a texel, and the
// terms telescope, so that the faces sum to 4 pi.
double plane_solid_angle(double x0, double x1, double y0, double y1) {
  return corner_solid_angle(x1, y1) - corner_solid_angle(x0, y1) - corner_solid_angle(x1, y0) +
         corner_solid_angle(x0, y0);
}

double cube_texel_solid_angle(int x, int y, int size) {
  return plane_solid_angle(2.0 * x / size - 1, 2.0 * (x + 1) / size - 1, 2.0 * y / size - 1,
                           2.0 * (y + 1) / size - 1);
}

// The four terms of each texel stand at corners that its neighbours share.
CubeSolidAngles::CubeSolidAngles(int size) : size_(size) {
  const int half = (size + 1) / 2;
  const auto line = [&](int y) {
    std::vector<double> corners;
    for (int x = 0; x <= half; ++x) {
      corners.push_back(corner_solid_angle(2.0 * x / size - 1, 2.0 * y / size - 1));
    }
    return corners;
  };
  std::vector<double> above = line(0);
  for (int y = 0; y < half; ++y) {
    std::vector<double> below = line(y + 1);
    for (size_t x = 0; x < static_cast<size_t>(half); ++x) {
      texels_.push_back(below[x + 1] - below[x] - above[x + 1] + above[x]);
    }
    above.swap(below);
  }
}

// Exact: the row spans colatitudes [t0, t1], and cos t0 - cos t1 = 2 sin((t0+t1)/2) sin((t1-t0)/2),
// which does not cancel at the poles.
double latlong_texel_solid_angle(int y, int width, int height) {
  const double middle = kPi * (y + 0.5) / height;
  return 4 * kPi / width * pinned_sin_cos(middle).sin * pinned_sin_cos(kPi / (2.0 * height)).sin;
}

// With d = t1 - t0 and t the row's middle, the direction's part along the equator integrates to
//   int sin^2 = (d - sin d cos 2t) / 2 = (d - sin d) / 2 + sin d sin^2 t
// times the chord 2 sin(pi / W) of the texel's longitudes, the part along the axis to
//   int sin cos = sin d sin 2t / 2
// times their arc 2 pi / W.
Vec3d latlong_texel_moment(int x, int y, int width, int height) {
  const double d = kPi / height, middle = kPi * (y + 0.5) / height;
  const double sine = std::sin(middle), cube = d * d * d;
  // d - sin d by its series where the difference would cancel.
  const double excess = d < 0.02 ? cube / 6 * (1 - d * d / 20) : d - std::sin(d);
  const double across = (excess / 2 + std::sin(d) * sine * sine) * 2 * std::sin(kPi / width);
  const double along = std::sin(d) * std::sin(2 * middle) / 2 * (2 * kPi / width);
  const Vec3d outward = latlong_direction((x + 0.5) / width, 0.5);
  return {outward.x * across, along, outward.z * across};
}

double cap_solid_angle(double half_angle_rad) {
  const double s = pinned_sin_cos(half_angle_rad / 2).sin;
  return 4 * kPi * s * s;
}

}  // namespace lightkiln
