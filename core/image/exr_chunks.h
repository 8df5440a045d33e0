#pragma once

// The blocks that an OpenEXR file stores its pixels in, checked before the library decodes them.
// OpenEXR 3.1.5 accepts an uncompressed, RLE or ZIP block that unpacks to fewer bytes than its
// pixels need and returns whatever its buffer held before; here such a block is an error.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lightkiln {

struct ExrChannelLayout {
  int bytes = 0;  // per sample
  int x_sampling = 1, y_sampling = 1;
};

enum class ExrPacking { none, rle, zip, self_checked };  // the library checks all others itself

struct ExrLayout {
  bool multi_part = false;
  uint64_t chunks_before = 0;  // of the parts before the one to be read
  int min_x = 0, min_y = 0;    // the data window's corner
  int width = 0, height = 0;
  bool tiled = false;
  int block_width = 0, block_height = 0;  // of a tile; of a scan-line block the width of the image
  ExrPacking packing = ExrPacking::self_checked;
  std::vector<ExrChannelLayout> channels;
};

// Throws Error{invalid_input} unless every block of the full-resolution image lies inside the file
// and holds what its pixels need. Costs one inflation of ZIP files.
void check_exr_chunks(std::span<const std::byte> bytes, const ExrLayout& layout);

}  // namespace lightkiln
