#pragma once

// Points of a cube's texels, and what they tell of spherical harmonics.

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

// A texel of the stacked image by its row number (face * size + y) * size + x.
struct CubePlace {
  int face, x, y;
};
CubePlace cube_place(uint32_t texel, int size);

// d(omega)/d(area of the face [-1, 1]^2) in a unit direction.
double face_jacobian(const Vec3d& direction);

// A point of a texel: the direction through it, and d(omega)/d(area of the face [-1, 1]^2) there.
struct CubePoint {
  Vec3d direction;
  double jacobian;
};
CubePoint cube_point(const CubePlace& place, int size, double within_x, double within_y);

// Gathers one replicate's share of the harmonics of one texel.
//
// With weights w_i = J_i dOmega / sum J, which sum to the texel's solid angle whatever points were
// drawn, and the mean L' = sum w_i L_i / dOmega, the harmonics take
//   sum w_i y(d_i) (L_i - L') + L' integral of y = sum w_i y_i L_i + L' (integral y - sum w_i y_i),
// so that light that does not vary within the texel is integrated without noise.
class TexelHarmonics {
 public:
  // `bands` = 0 gathers nothing.
  TexelHarmonics(const CubePlace& place, int size, int bands);
  void begin();
  void add(const CubePoint& point, const Vec3d& radiance);
  // Adds the replicate's bands^2 coefficients.
  void end(std::span<Vec3d> coefficients) const;

 private:
  int bands_;
  double solid_angle_;
  double jacobians_ = 0;
  Vec3d radiance_;
  std::vector<double> integral_, basis_, basis_sum_;
  std::vector<Vec3d> radiance_sum_;
};

}  // namespace lightkiln
