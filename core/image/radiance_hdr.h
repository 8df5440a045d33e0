#pragma once

// Radiance .hdr (RGBE) in and out, from and to memory.

#include <cstddef>
#include <span>
#include <vector>

#include "core/image/exr.h"

namespace lightkiln {

// Reads flat, old and new run-length encoding, all eight orientations, EXPOSURE, COLORCORR and
// PRIMARIES (Rec. 709 when absent or all zero). GAMMA belongs to no published form of the format
// and is passed over, as other readers do. Throws Error: invalid_input when malformed or cut short,
// unsupported for XYZE, too_large as read_exr.
DecodedImage read_radiance_hdr(std::span<const std::byte> bytes);

// Three channels, new run-length encoding, "-Y H +X W". A channel errs by at most 2^-8 of the
// pixel's largest one. Throws Error{invalid_input} for a value that is negative, not finite or
// 2^126 and above; alpha is dropped.
std::vector<std::byte> write_radiance_hdr(const Image& image);

}  // namespace lightkiln
