// How files are packed: as fast as threads allow, and only where it makes them smaller.

#include <bit>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "tests/image/exr_files.h"

namespace lightkiln {
namespace {

using test::ramp;

// Values of a smooth ramp whose lower 16 bits are noise: what filtered radiance looks like to ZIP.
Image noisy_ramp(int width, int height) {
  Image image = ramp(width, height, 3);
  uint32_t state = 1;
  for (float& value : image.pixels) {
    state = 1664525u * state + 1013904223u;
    value = std::bit_cast<float>((std::bit_cast<uint32_t>(value) & 0xff800000u) | state >> 9);
  }
  return image;
}

ExrWriteOptions float_options(int threads = 1) {
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  options.threads = threads;
  return options;
}

TEST(ExrWrite, GivesTheSameBytesForAnyNumberOfThreads) {
  const Image smooth = ramp(96, 576, 3), noisy = noisy_ramp(96, 576);
  for (const ExrPixelType type : {ExrPixelType::half, ExrPixelType::float32}) {
    ExrWriteOptions options = float_options();
    options.pixel_type = type;
    const auto one = write_exr(smooth, options), one_noisy = write_exr(noisy, options);
    for (const int threads : {0, 2, 8, 3}) {
      options.threads = threads;
      EXPECT_EQ(write_exr(smooth, options), one) << threads;
      EXPECT_EQ(write_exr(noisy, options), one_noisy) << threads;
    }
  }
}

TEST(ExrWrite, GivesTheSameBytesOfEveryLevelForAnyNumberOfThreads) {
  std::vector<Image> levels;
  for (int level = 0; level < 4; ++level) levels.push_back(ramp(256 >> level, 1536 >> level, 3));
  const auto one = write_exr_mipmapped(levels, float_options(1));
  for (const int threads : {2, 8}) {
    EXPECT_EQ(write_exr_mipmapped(levels, float_options(threads)), one) << threads;
  }
}

TEST(ExrWrite, PacksWhatGetsSmallerAndLeavesNoiseAsItIs) {
  const Image smooth = ramp(64, 384, 3), noisy = noisy_ramp(64, 384);
  const auto packed = write_exr(smooth, float_options());
  const auto whole = write_exr(noisy, float_options());
  const size_t raw = smooth.pixels.size() * sizeof(float);
  EXPECT_LT(packed.size(), raw / 2);
  EXPECT_GE(whole.size(), raw);
  EXPECT_LT(whole.size(), raw + raw / 20);
  const DecodedImage packed_image = read_exr(packed), whole_image = read_exr(whole);
  EXPECT_EQ(packed_image.format, "OpenEXR, 32-bit float, ZIP");
  EXPECT_EQ(whole_image.format, "OpenEXR, 32-bit float, uncompressed");
  EXPECT_EQ(packed_image.image.pixels, smooth.pixels);
  EXPECT_EQ(whole_image.image.pixels, noisy.pixels);
}

TEST(ExrWrite, LeavesTheLevelsOfANoisyChainAsTheyAre) {
  const std::vector<Image> chain = {noisy_ramp(64, 384), noisy_ramp(32, 192)};
  const auto bytes = write_exr_mipmapped(chain, float_options(2));
  EXPECT_EQ(read_exr(bytes).format, "OpenEXR, 32-bit float, uncompressed, tiled");
  const std::vector<Image> got = read_exr_levels(bytes);
  for (size_t level = 0; level < chain.size(); ++level) {
    EXPECT_EQ(got[level].pixels, chain[level].pixels) << level;
  }
}

// Noise in the rows between those of the sample does not decide; noise in most of an image does.
TEST(ExrWrite, JudgesByRowsFromTheWholeImage) {
  Image half_noisy = ramp(64, 384, 3);
  const Image noise = noisy_ramp(64, 384);
  const size_t half = half_noisy.pixels.size() / 2;
  std::copy_n(noise.pixels.begin(), half, half_noisy.pixels.begin());
  EXPECT_EQ(read_exr(write_exr(half_noisy, float_options())).format, "OpenEXR, 32-bit float, ZIP");
}

}  // namespace
}  // namespace lightkiln
