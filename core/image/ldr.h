#pragma once

// PNG and JPEG in, PNG out: 8 bits a channel.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"

namespace lightkiln {

struct Image8 {
  int width = 0;
  int height = 0;
  int channels = 0;             // always 4 after reading
  std::vector<uint8_t> pixels;  // as stored (sRGB for colour), [(y * width + x) * channels + c]
};

// Decodes PNG or JPEG to RGBA. Throws Error: invalid_input when malformed, too_large above
// 16384 a side or 67,108,864 pixels.
Image8 read_ldr(std::span<const std::byte> bytes);

std::vector<std::byte> write_png(const Image8& image);

// IEC 61966-2-1.
float srgb_to_linear(uint8_t encoded);
uint8_t linear_to_srgb(float linear);

}  // namespace lightkiln
