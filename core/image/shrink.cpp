#include "core/image/shrink.h"

#include <algorithm>

namespace lightkiln {

// Each small texel is the mean of the block of whole texels that falls to it. The scale is one
// number for both sides, so that proportions stay.
Image shrink(const Image& image, int max_side) {
  const int longest = std::max(image.width, image.height);
  if (longest <= max_side) return image;
  const auto scaled = [&](int size) {
    return std::max(1, static_cast<int>(static_cast<int64_t>(size) * max_side / longest));
  };
  Image small(scaled(image.width), scaled(image.height), image.channels);
  for (int y = 0; y < small.height; ++y)
    for (int x = 0; x < small.width; ++x) {
      const auto first = [](int i, int from, int to) {
        return static_cast<int>(static_cast<int64_t>(i) * from / to);
      };
      const int x0 = first(x, image.width, small.width);
      const int x1 = std::max(x0 + 1, first(x + 1, image.width, small.width));
      const int y0 = first(y, image.height, small.height);
      const int y1 = std::max(y0 + 1, first(y + 1, image.height, small.height));
      for (int c = 0; c < image.channels; ++c) {
        double sum = 0;
        for (int v = y0; v < y1; ++v)
          for (int u = x0; u < x1; ++u) sum += image.at(u, v)[c];
        small.at(x, y)[c] = static_cast<float>(sum / ((x1 - x0) * (y1 - y0)));
      }
    }
  return small;
}

}  // namespace lightkiln
