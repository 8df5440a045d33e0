#pragma once

// Radiance .hdr (RGBE) in and out, from and to memory.

#include <cstddef>
#include <span>
#include <vector>

#include "core/image/exr.h"

namespace lightkiln {

// Reads flat, old and new run-length encoding, all eight orientations, EXPOSURE and COLORCORR.
// Throws Error as read_exr does.
DecodedImage read_radiance_hdr(std::span<const std::byte> bytes);

// Three channels, new run-length encoding, "-Y H +X W".
std::vector<std::byte> write_radiance_hdr(const Image& image);

}  // namespace lightkiln
