// Source: "OpenEXR File Layout", Academy Software Foundation, version 3.1: magic and version (8
// bytes), headers of attributes, block offset tables, blocks. All numbers are little-endian.

#include "core/image/exr_chunks.h"

#include <algorithm>
#include <cstring>
#include <string>

#include <zlib.h>

#include "core/base/error.h"

namespace lightkiln {

namespace {

[[noreturn]] void malformed(const std::string& what) {
  throw Error(ErrorCode::invalid_input, "The OpenEXR image is malformed: " + what + ".");
}

uint64_t little_endian(std::span<const std::byte> bytes, size_t at, size_t count) {
  if (at > bytes.size() || count > bytes.size() - at) malformed("it ends too early");
  uint64_t value = 0;
  for (size_t i = count; i-- > 0;) value = value << 8 | std::to_integer<uint64_t>(bytes[at + i]);
  return value;
}

// The place after a text that ends in a zero byte.
size_t after_text(std::span<const std::byte> bytes, size_t at) {
  const auto end =
      std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(), std::byte{0});
  if (end == bytes.end()) malformed("its header does not end");
  return static_cast<size_t>(end - bytes.begin()) + 1;
}

// An attribute is a name, a type, a size and a value; an empty name ends a header; in a multi-part
// file an empty header ends the headers.
size_t headers_end(std::span<const std::byte> bytes, bool multi_part) {
  size_t at = 8;
  for (bool empty = true;;) {
    const size_t value = after_text(bytes, at);
    if (value == at + 1) {
      if (empty || !multi_part) return value;
      empty = true;
      at = value;
      continue;
    }
    empty = false;
    const size_t size_at = after_text(bytes, value);
    const uint64_t size = little_endian(bytes, size_at, 4);
    at = size_at + 4;
    if (size > bytes.size() - at) malformed("its header does not end");
    at += size;
  }
}

// How many multiples of `step` lie in [begin, begin + count).
int64_t samples(int64_t begin, int64_t count, int64_t step) {
  const auto floor_divide = [&](int64_t a) {
    return a >= 0 ? a / step : -((-a + step - 1) / step);
  };
  return floor_divide(begin + count - 1) - floor_divide(begin - 1);
}

// The bytes that the samples of a block take, unpacked.
int64_t block_bytes(const ExrLayout& layout, int x, int y) {
  const int64_t width = std::min(layout.block_width, layout.width - x);
  const int64_t height = std::min(layout.block_height, layout.height - y);
  int64_t bytes = 0;
  for (const ExrChannelLayout& channel : layout.channels) {
    bytes += channel.bytes * samples(int64_t{layout.min_x} + x, width, channel.x_sampling) *
             samples(int64_t{layout.min_y} + y, height, channel.y_sampling);
  }
  return bytes;
}

// A count below zero copies that many bytes; one of zero or more repeats the next byte count + 1
// times.
int64_t rle_bytes(std::span<const std::byte> packed) {
  int64_t bytes = 0;
  for (size_t at = 0; at < packed.size();) {
    const int count = static_cast<int8_t>(std::to_integer<uint8_t>(packed[at]));
    bytes += count < 0 ? -count : count + 1;
    at += count < 0 ? 1 + static_cast<size_t>(-count) : 2;
  }
  return bytes;
}

int64_t zip_bytes(std::span<const std::byte> packed, std::vector<Bytef>& scratch) {
  uLongf count = scratch.size();
  const auto* source = reinterpret_cast<const Bytef*>(packed.data());
  return uncompress(scratch.data(), &count, source, packed.size()) == Z_OK
             ? static_cast<int64_t>(count)
             : -1;
}

// A block that is not smaller than its pixels is stored as it is.
bool complete(const ExrLayout& layout, std::span<const std::byte> packed, int64_t needed,
              std::vector<Bytef>& scratch) {
  if (static_cast<int64_t>(packed.size()) >= needed) return true;
  switch (layout.packing) {
    case ExrPacking::none:
      return false;
    case ExrPacking::rle:
      return rle_bytes(packed) == needed;
    case ExrPacking::zip:
      scratch.resize(static_cast<size_t>(needed));
      return zip_bytes(packed, scratch) == needed;
    case ExrPacking::self_checked:
      break;
  }
  return true;
}

}  // namespace

void check_exr_chunks(std::span<const std::byte> bytes, const ExrLayout& layout) {
  const uint64_t table = headers_end(bytes, layout.multi_part) + 8 * layout.chunks_before;
  // Before a block's size stand its part (in a multi-part file) and its place: y, or tile x, tile
  // y, level x, level y.
  const size_t size_at = (layout.multi_part ? 4u : 0u) + (layout.tiled ? 16u : 4u);
  std::vector<Bytef> scratch;
  uint64_t index = 0;
  for (int y = 0; y < layout.height; y += layout.block_height) {
    for (int x = 0; x < layout.width; x += layout.block_width, ++index) {
      const uint64_t offset = little_endian(bytes, table + 8 * index, 8);
      if (offset == 0) malformed("it is incomplete, as it was never written to the end");
      if (offset > bytes.size()) malformed("it ends too early");
      const uint64_t size = little_endian(bytes, offset + size_at, 4);
      const uint64_t data = offset + size_at + 4;
      if (size > bytes.size() - data) malformed("it ends too early");
      if (!complete(layout, bytes.subspan(data, size), block_bytes(layout, x, y), scratch)) {
        malformed("the block of pixels that begins at column " + std::to_string(x) + " and row " +
                  std::to_string(y) + " is damaged or too short");
      }
    }
  }
}

}  // namespace lightkiln
