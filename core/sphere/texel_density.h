#pragma once

// Solid angle per texel area, tabulated for loops over images.

#include <vector>

#include "core/sphere/map_layout.h"

namespace lightkiln {

class TexelDensity {
 public:
  explicit TexelDensity(const MapLayout& layout);

  // d(solid angle)/d(area) in steradians per texel, as a linear function over texel (x, y): its
  // value at the texel's centre and what it grows by over a texel's width and height.
  struct Linear {
    float centre = 0, along_x = 0, along_y = 0;
  };
  const Linear& linear(int x, int y) const { return texels_[index(x, y)]; }

  // Its mean over the shown part of the texel; of a texel that a rim cuts, over all of it, with the
  // rim's density beyond.
  double operator()(int x, int y) const { return means_[index(x, y)]; }

 private:
  size_t index(int x, int y) const {
    const size_t row = static_cast<size_t>(y % rows_);
    return columns_ == 1 ? row
                         : row * static_cast<size_t>(columns_) + static_cast<size_t>(x % columns_);
  }
  void add(const MapLayout& layout, int x, int y, bool by_row, double mean);

  // One column where rows are uniform, one face for cubes, else the whole image.
  int columns_ = 1, rows_ = 1;
  std::vector<float> means_;
  std::vector<Linear> texels_;
};

}  // namespace lightkiln
