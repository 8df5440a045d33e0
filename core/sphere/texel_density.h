#pragma once

// Solid angle per texel area, tabulated for loops over images.

#include <vector>

#include "core/sphere/map_layout.h"

namespace lightkiln {

class TexelDensity {
 public:
  explicit TexelDensity(const MapLayout& layout);

  // Mean of d(solid angle)/d(area) over the shown part of texel (x, y), in steradians per texel; 0
  // where its sample shows nothing.
  double operator()(int x, int y) const {
    const size_t row = static_cast<size_t>(y % rows_);
    return values_[columns_ == 1
                       ? row
                       : row * static_cast<size_t>(columns_) + static_cast<size_t>(x % columns_)];
  }

 private:
  // One column where rows are uniform, one face for cubes, else the whole image.
  int columns_ = 1, rows_ = 1;
  std::vector<float> values_;
};

}  // namespace lightkiln
