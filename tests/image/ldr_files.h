#pragma once

// 8-bit pictures, and JPEG files, which our own writers do not write.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/image/ldr.h"

namespace lightkiln::test {

// Smooth in some places and noisy in others.
Image8 pattern8(int width, int height, int channels);

// Baseline JPEG of quality 95; `image` has 3 channels.
std::vector<std::byte> make_jpeg(const Image8& image);

// A PNG file of any kind: `rows` are the unfiltered scan lines, packed as the kind packs them.
struct PngRecipe {
  int width = 0, height = 0;
  int bits = 8;
  int color_type = 2;                      // 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA
  std::vector<uint8_t> palette = {};       // RGB a colour
  std::vector<uint8_t> transparency = {};  // the chunk tRNS
  uint32_t gamma = 0;                      // the chunk gAMA; 0 = none
  bool srgb_chunk = false;
};
std::vector<std::byte> make_png(const PngRecipe& recipe, const std::vector<uint8_t>& rows);

}  // namespace lightkiln::test
