// Sources: ISO/IEC 15948 (PNG), ITU-T T.81 (JPEG marker syntax), IEC 61966-2-1 (sRGB).

#include "core/image/ldr.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>

#include <zlib.h>

#include "core/base/error.h"

namespace {

// The decoder grows its buffers as the file asks; this stops one that asks for more than any image
// of the stated size can need.
thread_local size_t g_largest_allocation = 0;
thread_local bool g_asked_for_more = false;

bool allowed(size_t size) {
  if (size > g_largest_allocation) g_asked_for_more = true;
  return size <= g_largest_allocation;
}
void* limited_malloc(size_t size) {
  return allowed(size) ? std::malloc(size) : nullptr;
}
void* limited_realloc(void* memory, size_t size) {
  return allowed(size) ? std::realloc(memory, size) : nullptr;
}

}  // namespace

#define STBI_MALLOC(size) limited_malloc(size)
#define STBI_REALLOC(memory, size) limited_realloc(memory, size)
#define STBI_FREE(memory) std::free(memory)
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace lightkiln {

namespace {

constexpr unsigned char kPngSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

[[noreturn]] void malformed(const std::string& format, const std::string& what) {
  throw Error(ErrorCode::invalid_input, "The " + format + " image is malformed: " + what + ".");
}

uint32_t big_endian(const std::byte* bytes) {
  uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8 | std::to_integer<uint32_t>(bytes[i]);
  return value;
}

uint32_t checksum(const std::byte* bytes, size_t count) {
  const auto* data = reinterpret_cast<const Bytef*>(bytes);
  return static_cast<uint32_t>(crc32_z(crc32_z(0, nullptr, 0), data, count));
}

// The decoder itself checks no checksum and would pass damage on as texture.
void check_png(std::span<const std::byte> bytes) {
  for (size_t at = sizeof kPngSignature;;) {
    if (bytes.size() - at < 12) malformed("PNG", "it ends before its end chunk");
    const size_t length = big_endian(&bytes[at]);
    if (length > bytes.size() - at - 12) malformed("PNG", "it ends before its end chunk");
    const std::byte* type = &bytes[at + 4];
    const bool critical = (std::to_integer<unsigned>(type[0]) & 0x20) == 0;
    if (critical && checksum(type, length + 4) != big_endian(&bytes[at + 8 + length])) {
      malformed("PNG", "the checksum of its chunk at byte " + std::to_string(at) + " is wrong");
    }
    if (std::memcmp(type, "IEND", 4) == 0) return;
    at += length + 12;
  }
}

// Huffman tables of a DHT segment: class and number, 16 counts of codes by length, a value per
// code. No table has more than 256 codes; the decoder writes past its arrays when one claims to.
void check_huffman_tables(std::span<const std::byte> segment) {
  while (!segment.empty()) {
    size_t codes = 0;
    for (size_t i = 1; i <= 16 && i < segment.size(); ++i)
      codes += std::to_integer<size_t>(segment[i]);
    if (codes > 256 || segment.size() < 17 + codes)
      malformed("JPEG", "one of its Huffman tables is damaged");
    segment = segment.subspan(17 + codes);
  }
}

// The decoder fills what is missing at the end with grey. A complete file has an end marker outside
// its segments: walk the segments, and in coded data skip stuffed bytes and restart markers.
void check_jpeg(std::span<const std::byte> bytes) {
  const auto byte = [&](size_t at) {
    if (at >= bytes.size()) malformed("JPEG", "it ends before its end marker");
    return std::to_integer<unsigned>(bytes[at]);
  };
  bool coded = false;
  for (size_t at = 2;;) {
    const unsigned marker = byte(at + 1);
    if (byte(at) != 0xff || marker == 0xff) {  // coded data, or a fill byte
      ++at;
      continue;
    }
    at += 2;
    if (marker == 0xd9) {
      if (!coded) malformed("JPEG", "it holds no image data");
      return;
    }
    const bool standalone = marker == 0x00 || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
    if (standalone) continue;
    const size_t length = byte(at) * 256 + byte(at + 1);
    if (length < 2) malformed("JPEG", "one of its segments has no length");
    byte(at + length - 1);
    if (marker == 0xc4) check_huffman_tables(bytes.subspan(at + 2, length - 2));
    if (marker == 0xda) coded = true;
    at += length;
  }
}

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
  append_big_endian(bytes, checksum(&bytes[begin], bytes.size() - begin));
}

// encoded = linear <= 0.0031308 ? 12.92 linear : 1.055 linear^(1/2.4) - 0.055, and its inverse.
double srgb_decode(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}
double srgb_encode(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace

Image8 read_ldr(std::span<const std::byte> bytes) {
  const bool png = bytes.size() >= sizeof kPngSignature &&
                   std::memcmp(bytes.data(), kPngSignature, sizeof kPngSignature) == 0;
  const bool jpeg = bytes.size() >= 3 && bytes[0] == std::byte{0xff} &&
                    bytes[1] == std::byte{0xd8} && bytes[2] == std::byte{0xff};
  if (!png && !jpeg)
    throw Error(ErrorCode::invalid_input,
                "The image is neither PNG nor JPEG: its first bytes differ.");
  const std::string format = png ? "PNG" : "JPEG";
  // Held far below what the decoder's int can count.
  if (bytes.size() > size_t{1} << 30)
    throw Error(ErrorCode::too_large, "The " + format + " image is larger than 1 GiB.");
  png ? check_png(bytes) : check_jpeg(bytes);

  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int size = static_cast<int>(bytes.size());
  Image8 image;
  g_largest_allocation = size_t{1} << 20;  // more than reading a header takes
  g_asked_for_more = false;
  if (!stbi_info_from_memory(data, size, &image.width, &image.height, &image.channels))
    malformed(format, stbi_failure_reason());
  check_image_size(image.width, image.height, "A " + format + " image");
  // The largest buffer is the unpacked 16-bit RGBA or the file itself, doubled as it grows; blocks
  // of up to 32 pixels overhang at the edges.
  g_largest_allocation =
      2 * bytes.size() + (size_t{1} << 20) +
      16 * (static_cast<size_t>(image.width) + 64) * (static_cast<size_t>(image.height) + 64);
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(data, size, &image.width, &image.height, &image.channels, 4),
      std::free);
  if (!pixels && g_asked_for_more) malformed(format, "it unpacks to more than its size allows");
  if (!pixels) malformed(format, stbi_failure_reason());
  image.channels = 4;
  const size_t count = static_cast<size_t>(image.width) * static_cast<size_t>(image.height) * 4;
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

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

float srgb_to_linear(uint8_t encoded) {
  static const auto table = [] {
    std::array<float, 256> values{};
    for (size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<float>(srgb_decode(static_cast<double>(i) / 255));
    return values;
  }();
  return table[encoded];
}

uint8_t linear_to_srgb(float linear) {
  if (!(linear > 0)) return 0;
  const double encoded = srgb_encode(std::min(static_cast<double>(linear), 1.0));
  return static_cast<uint8_t>(std::lround(255 * encoded));
}

}  // namespace lightkiln
