#include "core/image/decode.h"

#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/image/ldr.h"
#include "core/image/radiance_hdr.h"
#include "tests/image/exr_files.h"
#include "tests/image/ldr_files.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

TEST(Decode, ChoosesTheReaderByTheFirstBytes) {
  const Image image = test::ramp(12, 6, 3);
  EXPECT_EQ(decode_hdr_image(write_exr(image, {})).format, "OpenEXR, 16-bit float, ZIP");
  EXPECT_EQ(decode_hdr_image(write_radiance_hdr(image)).format, "Radiance HDR, 32-bit RGBE");
}

TEST(Decode, NamesWhatItFoundInstead) {
  EXPECT_REFUSED(decode_hdr_image({}), invalid_input, "an empty file");
  EXPECT_REFUSED(decode_hdr_image(write_png(test::pattern8(2, 2, 3))), invalid_input,
                 "a PNG image");
  EXPECT_REFUSED(decode_hdr_image(test::make_jpeg(test::pattern8(9, 9, 3))), invalid_input,
                 "a JPEG image");
  const std::byte unknown[] = {std::byte{0}, std::byte{1}};
  EXPECT_REFUSED(decode_hdr_image(unknown), invalid_input, "unknown kind");
}

// Values that are no light are counted by kind and made 0; the rest keeps its bits.
TEST(Sanitise, CountsEachKindAndLeavesTheRestAlone) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const Image clean = test::ramp(50, 40, 3);
  Image dirty = clean, expected = clean;
  const auto spoil = [&](size_t at, float value) {
    dirty.pixels[at] = value;
    expected.pixels[at] = 0;
  };
  for (size_t i = 0; i < 17; ++i) spoil(11 * i, std::numeric_limits<float>::quiet_NaN());
  for (size_t i = 0; i < 5; ++i) spoil(1000 + 13 * i, i % 2 ? kInfinity : -kInfinity);
  for (size_t i = 0; i < 9; ++i) spoil(2000 + 3 * i, i % 2 ? -1e-30f : -5.0f);
  const PixelRepairs repairs = sanitise(dirty);
  EXPECT_EQ(repairs.nan, 17u);
  EXPECT_EQ(repairs.infinite, 5u);
  EXPECT_EQ(repairs.negative, 9u);
  EXPECT_EQ(dirty.pixels, expected.pixels);
  const PixelRepairs again = sanitise(dirty);
  EXPECT_EQ(again.nan + again.infinite + again.negative, 0u);
}

TEST(Sanitise, KeepsTheLargestFiniteValue) {
  Image image(1, 1, 3);
  image.pixels = {std::numeric_limits<float>::max(), std::numeric_limits<float>::denorm_min(), 0};
  const auto before = image.pixels;
  const PixelRepairs repairs = sanitise(image);
  EXPECT_EQ(repairs.infinite + repairs.nan + repairs.negative, 0u);
  EXPECT_EQ(image.pixels, before);
}

Image8 show(std::vector<float> rgb, double stops = 0) {
  Image image(1, 1, static_cast<int>(rgb.size()));
  image.pixels = std::move(rgb);
  return tonemap(image, {stops});
}

TEST(Tonemap, FollowsThePublishedCurve) {
  // Below the bend a grey of v >= 0.08 loses 0.04; below 0.08 it becomes 6.25 v^2.
  EXPECT_EQ(show({0.5f, 0.5f, 0.5f}).pixels[0], linear_to_srgb(0.46f));
  EXPECT_EQ(show({0.04f, 0.04f, 0.04f}).pixels[0], linear_to_srgb(0.01f));
  // White 1: peak 0.96, bent to 1 - 0.24^2 / (0.96 + 0.24 - 0.76) = 0.869091.
  EXPECT_EQ(show({1, 1, 1}).pixels[0], linear_to_srgb(0.869091f));
  // Red 4: 4 - 0 offset; peak 4 to 1 - 0.0576 / 3.48 = 0.983448; white share
  // 1 - 1 / (0.15 * (4 - 0.983448) + 1) = 0.311526.
  const Image8 red = show({4, 0, 0});
  EXPECT_EQ(red.pixels[0], linear_to_srgb(0.983448f));
  EXPECT_EQ(red.pixels[1], linear_to_srgb(0.311526f * 0.983448f));
}

TEST(Tonemap, NeverDarkensWhatIsBrighter) {
  int last = 0;
  for (float value = 1e-4f; value < 1e6f; value *= 1.05f) {
    const int shown = show({value, value, value}).pixels[0];
    EXPECT_GE(shown, last) << value;
    last = shown;
  }
  EXPECT_EQ(last, 255);
}

TEST(Tonemap, CountsExposureInStops) {
  EXPECT_EQ(show({0.1f, 0.2f, 0.3f}, 1).pixels, show({0.2f, 0.4f, 0.6f}).pixels);
  EXPECT_EQ(show({0.1f, 0.2f, 0.3f}, -2).pixels, show({0.025f, 0.05f, 0.075f}).pixels);
}

TEST(Tonemap, ShowsWhatCannotBeShownAsBlackOrWhite) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(show({kNan, -1, 0}).pixels, (std::vector<uint8_t>{0, 0, 0}));
  EXPECT_EQ(show({kInfinity, kInfinity, kInfinity}).pixels, (std::vector<uint8_t>{255, 255, 255}));
}

TEST(Tonemap, KeepsAlphaLinearAndSpreadsLuminance) {
  const Image8 shown = show({0.5f, 0.5f, 0.5f, 0.5f});
  EXPECT_EQ(shown.channels, 4);
  EXPECT_EQ(shown.pixels[3], 128);
  EXPECT_EQ(show({0.5f}).pixels, show({0.5f, 0.5f, 0.5f}).pixels);
}

}  // namespace
}  // namespace lightkiln
