#pragma once

// OpenEXR in and out, from and to memory. The only user of OpenEXR.

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"

namespace lightkiln {

enum class ExrPixelType { half, float32 };

struct ExrWriteOptions {
  ExrPixelType pixel_type = ExrPixelType::half;  // half refuses values above 65504: see write_exr
  EnvmapAttribute envmap = EnvmapAttribute::none;
  // Text attributes, written in key order. No time stamp: equal pixels give equal bytes.
  std::map<std::string, std::string> attributes;
  // To compress on: 1 = the caller's own, 0 = one per processor. The bytes do not depend on it.
  int threads = 1;
};

// Reads scan-line or tiled files (level 0) of any compression; of a multi-part file the first part
// with R, G and B, or Y, or Y, RY and BY. Other channels, alpha among them, are dropped; stated
// chromaticities are converted to Rec. 709 with white kept white. Throws Error: invalid_input when
// malformed, cut short or incomplete; unsupported when deep, without such channels or subsampled
// otherwise; too_large above the limits of image.h. NaN, infinite and negative values are returned
// as stored (the conversion of a pixel that holds one spreads it to all three channels).
DecodedImage read_exr(std::span<const std::byte> bytes);

// The text attribute `name` of the part that read_exr reads; "" where the file has none, or is not
// OpenEXR. Throws as read_exr for an OpenEXR file without such a part.
std::string exr_text(std::span<const std::byte> bytes, const std::string& name);

// Every level of a mip-mapped file that read_exr reads, level 0 first, to 1 x 1; one image of any
// other file. Throws as read_exr.
std::vector<Image> read_exr_levels(std::span<const std::byte> bytes);

// Writes a single-part scan-line file with channels R, G, B (A) or Y, chromaticities of Rec. 709,
// ZIP-compressed unless a sample of its rows shows that it would save less than a tenth. With
// `half`, a value that half cannot hold (above 65504) makes the whole file 32-bit float; the result
// says which was written through `written` when it is not null.
std::vector<std::byte> write_exr(const Image& image, const ExrWriteOptions& options,
                                 ExrPixelType* written = nullptr);

// Levels of a full mip-map of `width` x `height` pixels: floor(log2(longer side)) + 1.
int exr_level_count(int width, int height);

// Writes one tiled (64 x 64) mip-mapped file, compressed as write_exr does, with levels rounded
// down, from a strip of cube faces or any other chain: level i is max(1, W >> i) x max(1, H >> i)
// pixels. The format has all levels down to 1 x 1: those below the last one given are filled with
// means of the one above, and the attribute "lightkiln.levels" says how many were given. One pixel
// type holds for all levels: a value in any of them that half cannot hold makes the whole file
// 32-bit float. Throws Error: invalid_input when a level has another size or number of channels;
// too_large as write_exr.
std::vector<std::byte> write_exr_mipmapped(std::span<const Image> levels,
                                           const ExrWriteOptions& options,
                                           ExrPixelType* written = nullptr);

}  // namespace lightkiln
