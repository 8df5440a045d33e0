#pragma once

// Exact solid angles, in steradians.

#include <vector>

#include "core/base/math.h"

namespace lightkiln {

// Texel (x, y) of a face of a cube with `size` texels a side. The six faces sum to 4 pi within
// 1e-12.
double cube_texel_solid_angle(int x, int y, int size);

// Those of a whole face, each worked out once: what passes over all texels read.
class CubeSolidAngles {
 public:
  explicit CubeSolidAngles(int size);
  // As cube_texel_solid_angle().
  double at(int x, int y) const {
    const int column = 2 * x < size_ ? x : size_ - 1 - x, row = 2 * y < size_ ? y : size_ - 1 - y;
    return texels_[static_cast<size_t>(row) * static_cast<size_t>((size_ + 1) / 2) +
                   static_cast<size_t>(column)];
  }

 private:
  int size_;
  std::vector<double> texels_;  // of the quarter at the face's first corner, by rows
};

// The rectangle [x0, x1] x [y0, y1] of a plane at distance 1.
double plane_solid_angle(double x0, double x1, double y0, double y1);

// Any texel of row y of a lat-long image; all rows times their widths sum to 4 pi within 1e-12.
double latlong_texel_solid_angle(int y, int width, int height);

// The integral of the unit direction over that texel: its solid angle times its mean direction.
Vec3d latlong_texel_moment(int x, int y, int width, int height);

// A cone of half-angle a: 4 pi sin^2(a/2), which does not cancel for a small sun.
double cap_solid_angle(double half_angle_rad);

}  // namespace lightkiln
