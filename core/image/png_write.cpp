// Source: ISO/IEC 15948 (PNG).

#include <algorithm>
#include <cstdlib>

#include <zlib.h>

#include "core/base/error.h"
#include "core/image/ldr.h"

namespace lightkiln {

namespace {

constexpr unsigned char kPngSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

int paeth(int left, int up, int corner) {
  const int estimate = left + up - corner;
  const int a = std::abs(estimate - left), b = std::abs(estimate - up);
  const int c = std::abs(estimate - corner);
  return a <= b && a <= c ? left : b <= c ? up : corner;
}

// One row through PNG filter `kind` (none, sub, up, average, Paeth); `above` is empty for the
// first.
void filter_row(int kind, std::span<const uint8_t> row, std::span<const uint8_t> above,
                size_t pixel, uint8_t* out) {
  for (size_t i = 0; i < row.size(); ++i) {
    const int left = i >= pixel ? row[i - pixel] : 0;
    const int up = above.empty() ? 0 : above[i];
    const int corner = i >= pixel && !above.empty() ? above[i - pixel] : 0;
    const int predicted[5] = {0, left, up, (left + up) / 2, paeth(left, up, corner)};
    out[i] = static_cast<uint8_t>(row[i] - predicted[kind]);
  }
}

// Rows with the filter whose output, read as signed bytes, sums to the least magnitude: the
// heuristic that the PNG specification recommends.
std::vector<uint8_t> filtered_rows(const Image8& image) {
  const auto pixel = static_cast<size_t>(image.channels);
  const size_t width = static_cast<size_t>(image.width) * pixel;
  const auto height = static_cast<size_t>(image.height);
  std::vector<uint8_t> rows(height * (width + 1)), candidate(width);
  for (size_t y = 0; y < height; ++y) {
    const std::span<const uint8_t> row(&image.pixels[y * width], width);
    const auto above = y ? std::span<const uint8_t>(&image.pixels[(y - 1) * width], width)
                         : std::span<const uint8_t>();
    uint8_t* out = &rows[y * (width + 1)];
    uint64_t least = UINT64_MAX;
    for (int kind = 0; kind < 5; ++kind) {
      filter_row(kind, row, above, pixel, candidate.data());
      uint64_t sum = 0;
      for (const uint8_t value : candidate)
        sum += static_cast<uint64_t>(std::abs(static_cast<int>(static_cast<int8_t>(value))));
      if (sum >= least) continue;
      least = sum;
      out[0] = static_cast<uint8_t>(kind);
      std::copy(candidate.begin(), candidate.end(), out + 1);
    }
  }
  return rows;
}

uint32_t checksum(std::span<const std::byte> bytes) {
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());
  return static_cast<uint32_t>(crc32_z(crc32_z(0, nullptr, 0), data, bytes.size()));
}

void append_big_endian(std::vector<std::byte>& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::byte>(value >> shift & 255));
}

void append_chunk(std::vector<std::byte>& bytes, const char* type,
                  std::span<const std::byte> data) {
  append_big_endian(bytes, static_cast<uint32_t>(data.size()));
  const size_t begin = bytes.size();
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::byte>(type[i]));
  bytes.insert(bytes.end(), data.begin(), data.end());
  append_big_endian(bytes, checksum(std::span(bytes).subspan(begin)));
}

}  // namespace

std::vector<std::byte> write_png(const Image8& image) {
  check_image_size(image.width, image.height, "A PNG image");
  const std::vector<uint8_t> rows = filtered_rows(image);
  uLongf packed_size = compressBound(static_cast<uLong>(rows.size()));
  std::vector<std::byte> packed(packed_size);
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &packed_size, rows.data(),
                static_cast<uLong>(rows.size()), 6) != Z_OK)
    throw Error(ErrorCode::out_of_memory, "There is not enough memory to write the PNG image.");
  packed.resize(packed_size);

  std::vector<std::byte> bytes;
  for (const unsigned char c : kPngSignature) bytes.push_back(static_cast<std::byte>(c));
  std::vector<std::byte> header;
  append_big_endian(header, static_cast<uint32_t>(image.width));
  append_big_endian(header, static_cast<uint32_t>(image.height));
  constexpr int kColorType[4] = {0, 4, 2, 6};
  for (const int value : {8, kColorType[image.channels - 1], 0, 0, 0})
    header.push_back(static_cast<std::byte>(value));
  append_chunk(bytes, "IHDR", header);
  append_chunk(bytes, "IDAT", packed);
  append_chunk(bytes, "IEND", {});
  return bytes;
}

}  // namespace lightkiln
