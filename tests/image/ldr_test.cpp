#include "core/image/ldr.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zlib.h>

#include "tests/image/ldr_files.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

using test::make_jpeg;
using test::pattern8;

TEST(Srgb, MatchesTheStandard) {
  EXPECT_EQ(srgb_to_linear(0), 0);
  EXPECT_EQ(srgb_to_linear(255), 1);
  // IEC 61966-2-1 at 10 (the straight part: 10/255/12.92) and 128.
  EXPECT_NEAR(srgb_to_linear(10), 0.0030352698, 1e-9);
  EXPECT_NEAR(srgb_to_linear(128), 0.2158605, 1e-7);
  EXPECT_EQ(linear_to_srgb(0.5f), 188);
  EXPECT_EQ(linear_to_srgb(0.18f), 118);
}

TEST(Srgb, InverseReturnsEveryCode) {
  for (int code = 0; code < 256; ++code) {
    EXPECT_EQ(linear_to_srgb(srgb_to_linear(static_cast<uint8_t>(code))), code);
    if (code) {
      EXPECT_GT(srgb_to_linear(static_cast<uint8_t>(code)),
                srgb_to_linear(static_cast<uint8_t>(code - 1)));
    }
  }
}

TEST(Srgb, ClampsWhatLiesOutside) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(linear_to_srgb(-1), 0);
  EXPECT_EQ(linear_to_srgb(-kInfinity), 0);
  EXPECT_EQ(linear_to_srgb(2), 255);
  EXPECT_EQ(linear_to_srgb(kInfinity), 255);
  EXPECT_EQ(linear_to_srgb(std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(Png, ReadsWhatItWrites) {
  for (int channels = 1; channels <= 4; ++channels) {
    for (const auto& [width, height] : {std::pair{1, 1}, {257, 3}, {64, 64}}) {
      const Image8 image = pattern8(width, height, channels);
      const Image8 got = read_ldr(write_png(image));
      ASSERT_EQ(got.width, width);
      ASSERT_EQ(got.height, height);
      ASSERT_EQ(got.channels, 4);
      const size_t count = static_cast<size_t>(width) * static_cast<size_t>(height);
      for (size_t i = 0; i < count; ++i) {
        const uint8_t* p = &image.pixels[i * static_cast<size_t>(channels)];
        const bool color = channels >= 3;
        const uint8_t expected[4] = {p[0], color ? p[1] : p[0], color ? p[2] : p[0],
                                     channels % 2 == 0 ? p[channels - 1] : uint8_t{255}};
        ASSERT_EQ(std::memcmp(&got.pixels[4 * i], expected, 4), 0) << channels << " at " << i;
      }
    }
  }
}

TEST(Png, EqualPixelsGiveEqualBytes) {
  const Image8 image = pattern8(100, 50, 3);
  EXPECT_EQ(write_png(image), write_png(image));
}

TEST(Png, RefusesEveryTruncation) {
  const auto bytes = write_png(pattern8(30, 20, 4));
  for (size_t keep = 0; keep < bytes.size(); ++keep)
    EXPECT_REFUSED(read_ldr(std::span(bytes).first(keep)), invalid_input, "");
}

// The decoder behind read_ldr checks no checksum; read_ldr does.
TEST(Png, RefusesEveryFlippedByte) {
  const auto bytes = write_png(pattern8(12, 9, 3));
  for (size_t at = 0; at < bytes.size(); ++at) {
    auto damaged = bytes;
    damaged[at] ^= std::byte{0x10};
    EXPECT_REFUSED(read_ldr(damaged), invalid_input, "");
  }
}

void put_big_endian(std::vector<std::byte>& bytes, size_t at, uint32_t value) {
  for (size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(value >> (24 - 8 * i));
}

// Sets the size in the header chunk, which stands at byte 8, and mends its checksum.
void claim_size(std::vector<std::byte>& png, uint32_t width, uint32_t height) {
  put_big_endian(png, 16, width);
  put_big_endian(png, 20, height);
  put_big_endian(png, 29,
                 static_cast<uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(&png[12]), 17)));
}

TEST(Png, RefusesSizesAboveTheLimits) {
  auto png = write_png(pattern8(4, 4, 4));
  claim_size(png, 16384, 16384);
  EXPECT_REFUSED(read_ldr(png), too_large, "67108864");
  claim_size(png, 8192, 8192);
  EXPECT_REFUSED(read_ldr(png), invalid_input, "");
}

int64_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return int64_t{usage.ru_maxrss} * 1024;
}

TEST(Png, RefusesToUnpackMoreThanItsSizeNeeds) {
  auto bomb = write_png(pattern8(8192, 8192, 1));
  claim_size(bomb, 4, 4);
  const int64_t before = peak_memory_bytes();
  EXPECT_REFUSED(read_ldr(bomb), invalid_input, "more than its size allows");
  EXPECT_LT(peak_memory_bytes() - before, 16 << 20);
}

TEST(Jpeg, ReadsColors) {
  Image8 image(pattern8(48, 32, 3));
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<uint8_t>(i % 3 == 0 ? 200 : i % 3 == 1 ? 100 : 50);
  const Image8 got = read_ldr(make_jpeg(image));
  ASSERT_EQ(got.width, 48);
  ASSERT_EQ(got.height, 32);
  ASSERT_EQ(got.channels, 4);
  const int expected[4] = {200, 100, 50, 255};
  for (size_t i = 0; i < got.pixels.size(); ++i)
    ASSERT_NEAR(got.pixels[i], expected[i % 4], 3) << i;
}

TEST(Jpeg, RefusesEveryTruncation) {
  const auto bytes = make_jpeg(pattern8(40, 40, 3));
  for (size_t keep = 0; keep < bytes.size(); ++keep)
    EXPECT_REFUSED(read_ldr(std::span(bytes).first(keep)), invalid_input, "");
  auto longer = bytes;  // what follows the end marker belongs to nobody
  longer.resize(longer.size() + 100);
  EXPECT_EQ(read_ldr(longer).pixels, read_ldr(bytes).pixels);
}

// The decoder alone writes past the end of its tables.
TEST(Jpeg, RefusesHuffmanTablesOfTooManyCodes) {
  const auto bytes = make_jpeg(pattern8(24, 24, 3));
  const std::byte marker[] = {std::byte{0xff}, std::byte{0xc4}};
  auto at = std::search(bytes.begin(), bytes.end(), marker, marker + 2);
  ASSERT_NE(at, bytes.end());
  for (std::ptrdiff_t count = 5; count < 21; ++count) {
    auto damaged = bytes;
    damaged[static_cast<size_t>(at - bytes.begin() + count)] = std::byte{0xff};
    EXPECT_REFUSED(read_ldr(damaged), invalid_input, "Huffman");
  }
}

TEST(Ldr, RefusesOtherFormats) {
  const std::byte gif[] = {std::byte{'G'}, std::byte{'I'}, std::byte{'F'}, std::byte{'8'}};
  EXPECT_REFUSED(read_ldr(gif), invalid_input, "neither PNG nor JPEG");
  EXPECT_REFUSED(read_ldr({}), invalid_input, "neither PNG nor JPEG");
}

}  // namespace
}  // namespace lightkiln
