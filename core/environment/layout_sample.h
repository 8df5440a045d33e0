#pragma once

// Reading an image of any layout at a place.

#include <vector>

#include "core/image/image.h"
#include "core/sphere/map_layout.h"

namespace lightkiln {

// A texel of a disc that the rim cuts, with its sample outside, has no value of its own: a texel
// further in on the same diameter stands for it. Others stand for themselves.
void find_value(const MapLayout& layout, int* x, int* y);

// The value of the texel that holds the place.
Vec3d nearest_radiance(const MapLayout& layout, const Image& image, const MapPlace& place);

// Bilinear between the four samples around the place, across seams, edges and poles; where a sample
// has no continuation (a cube's corner, a horizon) the others share its weight. A weighted mean: it
// never leaves the range of the four. Continuous, also from one chart to the next.
Vec3d smooth_radiance(const MapLayout& layout, const Image& image, const MapPlace& place);

// What makes interpolation keep energy where texels change their solid angle from row to row: a
// texel of the first row of a lat-long map, spread by plain bilinear weights, would give 8.3 % more
// light than it holds. Between rows j and j + 1, t of the way, the lower row's weight is
//   t + k t (1 - t)
// with k such that each of the two rows receives the solid angle of its own half of the way. For a
// density w(t) = 1 + g (t - 1/2) between them that asks
//   integral of w (1 - t - k t (1 - t)) over [0, 1] = integral of w over [0, 1/2],
//   (1/2 - g/12) - k/6 = 1/2 - g/8,   k = g / 4.
// |k| <= 1/2, so that weights stay in [0, 1].
class RowBlend {
 public:
  explicit RowBlend(const MapLayout& layout);
  // Of rows j and j + 1 of the image; 0 across its borders.
  double operator()(int j) const {
    return j >= 0 && static_cast<size_t>(j) < between_.size() ? between_[static_cast<size_t>(j)]
                                                              : 0;
  }

 private:
  std::vector<double> between_;  // empty = 0 everywhere
};

// smooth_radiance() with these weights.
Vec3d smooth_radiance(const MapLayout& layout, const Image& image, const MapPlace& place,
                      const RowBlend& blend);

}  // namespace lightkiln
