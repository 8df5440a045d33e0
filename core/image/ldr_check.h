#pragma once

// PNG and JPEG files, checked before the decoder sees them: it verifies no checksum, fills what is
// missing with grey and writes past its tables when a file claims too many codes.

#include <cstddef>
#include <cstdint>
#include <span>

namespace lightkiln {

struct LdrFacts {
  bool png = false;    // JPEG otherwise
  int components = 0;  // of a JPEG image: 1 grey, 3 colour, 4 for printing; 0 for PNG
  uint32_t gamma = 0;  // of a PNG image without an sRGB chunk, in 1/100000; 0 = not stated
};

// Throws Error{invalid_input} when the file is neither, malformed, cut short or (PNG) has a wrong
// checksum in a chunk that matters.
LdrFacts check_ldr(std::span<const std::byte> bytes);

}  // namespace lightkiln
