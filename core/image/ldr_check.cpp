// Sources: ISO/IEC 15948 (PNG), ITU-T T.81 (JPEG marker syntax).

#include "core/image/ldr_check.h"

#include <algorithm>
#include <cstring>
#include <string>

#include <zlib.h>

#include "core/base/error.h"

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
LdrFacts check_png(std::span<const std::byte> bytes) {
  LdrFacts facts;
  facts.png = true;
  bool srgb = false;
  for (size_t at = sizeof kPngSignature;;) {
    if (bytes.size() - at < 12) malformed("PNG", "it ends before its end chunk");
    const size_t length = big_endian(&bytes[at]);
    if (length > bytes.size() - at - 12) malformed("PNG", "it ends before its end chunk");
    const std::byte* type = &bytes[at + 4];
    const bool critical = (std::to_integer<unsigned>(type[0]) & 0x20) == 0;
    if (critical && checksum(type, length + 4) != big_endian(&bytes[at + 8 + length])) {
      malformed("PNG", "the checksum of its chunk at byte " + std::to_string(at) + " is wrong");
    }
    if (std::memcmp(type, "sRGB", 4) == 0) srgb = true;
    if (std::memcmp(type, "gAMA", 4) == 0 && length == 4) facts.gamma = big_endian(type + 4);
    if (std::memcmp(type, "IEND", 4) == 0) {
      if (srgb) facts.gamma = 0;
      return facts;
    }
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
LdrFacts check_jpeg(std::span<const std::byte> bytes) {
  LdrFacts facts;
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
      return facts;
    }
    const bool standalone = marker == 0x00 || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
    if (standalone) continue;
    const size_t length = byte(at) * 256 + byte(at + 1);
    if (length < 2) malformed("JPEG", "one of its segments has no length");
    byte(at + length - 1);
    if (marker == 0xc4) check_huffman_tables(bytes.subspan(at + 2, length - 2));
    // A frame header: length, precision, height, width, number of components.
    const bool frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (frame && length >= 8) facts.components = static_cast<int>(byte(at + 7));
    if (marker == 0xda) coded = true;
    at += length;
  }
}

}  // namespace

LdrFacts check_ldr(std::span<const std::byte> bytes) {
  const bool png = bytes.size() >= sizeof kPngSignature &&
                   std::memcmp(bytes.data(), kPngSignature, sizeof kPngSignature) == 0;
  const bool jpeg = bytes.size() >= 3 && bytes[0] == std::byte{0xff} &&
                    bytes[1] == std::byte{0xd8} && bytes[2] == std::byte{0xff};
  if (!png && !jpeg)
    throw Error(ErrorCode::invalid_input,
                "The image is neither PNG nor JPEG: its first bytes differ.");
  return png ? check_png(bytes) : check_jpeg(bytes);
}

}  // namespace lightkiln
