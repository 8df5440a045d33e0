#pragma once

// 8-bit pictures, and JPEG files, which our own writers do not write.

#include <cstddef>
#include <vector>

#include "core/image/ldr.h"

namespace lightkiln::test {

// Smooth in some places and noisy in others.
Image8 pattern8(int width, int height, int channels);

// Baseline JPEG of quality 95; `image` has 3 channels.
std::vector<std::byte> make_jpeg(const Image8& image);

}  // namespace lightkiln::test
