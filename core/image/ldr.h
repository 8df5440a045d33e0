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
  int channels = 0;             // 1 to 4; always 4 after reading
  std::vector<uint8_t> pixels;  // as stored (sRGB for colour), [(y * width + x) * channels + c]
};

// Decodes PNG or JPEG to RGBA; of 16-bit PNG the upper 8 bits. Throws Error: invalid_input when
// malformed, cut short or (PNG) with a wrong checksum, too_large above the limits of image.h.
Image8 read_ldr(std::span<const std::byte> bytes);

// The same files as light: sRGB to linear, values in [0, 1], three channels; all 16 bits of a
// 16-bit PNG count. Alpha is dropped, an embedded colour profile ignored. Throws Error as read_ldr,
// and unsupported for a JPEG of four components (CMYK) and a PNG that states another gamma than
// sRGB's.
DecodedImage read_ldr_as_light(std::span<const std::byte> bytes);

// Grey, grey and alpha, RGB or RGBA by the number of channels. Equal pixels give equal bytes.
std::vector<std::byte> write_png(const Image8& image);

// IEC 61966-2-1. The inverse rounds to nearest; values outside [0, 1] go to the nearer end, NaN to
// 0.
float srgb_to_linear(uint8_t encoded);
uint8_t linear_to_srgb(float linear);

}  // namespace lightkiln
