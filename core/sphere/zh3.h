#pragma once

// ZH3: linear spherical harmonics with a zonal third band, 15 numbers in place of 27, or 12 when
// the zonal coefficient is guessed. Source: Roughton, Sloan, Silvennoinen, Iwanicki, Shirley, "ZH3:
// Quadratic Zonal Harmonics", I3D 2024.

#include <array>

#include "core/sphere/harmonics.h"

namespace lightkiln {

struct Zh3 {
  // Radiance coefficients 00 1-1 10 11.
  std::array<Vec3d, 4> linear;
  // The direction of the linear band's luminance; +Z when that band is zero.
  Vec3d axis{0, 0, 1};
  // Radiance coefficient of y_20 about `axis`, per channel.
  Vec3d fitted;        // the projection of the map's third band: the best in squared error
  Vec3d hallucinated;  // from the linear bands alone
  // What irradiance loses against three full bands: rms over the sphere of the largest channel,
  // relative to that channel's mean irradiance.
  double linear_error = 0, hallucinated_error = 0, fitted_error = 0;
};

// Of at least one band of radiance; missing bands count as 0.
Zh3 make_zh3(const ShRgb& radiance);

// Irradiance at a surface with unit normal n, with `zonal` one of fitted or hallucinated.
Vec3d zh3_irradiance(const Zh3& zh3, const Vec3d& zonal, const Vec3d& normal);

}  // namespace lightkiln
