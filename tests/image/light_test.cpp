// Images that were not made as light, read as light: pictures for a screen, and windows of a
// larger picture.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/image/decode.h"
#include "core/image/ldr.h"
#include "core/image/radiance_hdr.h"
#include "tests/image/exr_files.h"
#include "tests/image/ldr_files.h"
#include "tests/image/refusals.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::ExrRecipe;
using test::make_exr;
using test::make_jpeg;
using test::make_png;
using test::pattern8;
using test::PngRecipe;
using test::ramp;

// IEC 61966-2-1.
double linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

void expect_near(const Image& got, const std::vector<double>& expected) {
  ASSERT_EQ(got.channels, 3);
  ASSERT_EQ(got.pixels.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(got.pixels[i], expected[i], 1e-7) << i;
}

TEST(PngAsLight, ReadsEveryKindOfPixel) {
  const double mid = linear(128 / 255.0), low = linear(51 / 255.0);
  const DecodedImage rgb = decode_light_image(make_png({2, 1, 8, 2}, {0, 51, 128, 255, 0, 51}));
  EXPECT_EQ(rgb.format, "PNG, 8-bit sRGB");
  EXPECT_TRUE(rgb.display_referred);
  expect_near(rgb.image, {0, low, mid, 1, 0, low});
  expect_near(decode_light_image(make_png({2, 1, 8, 0}, {51, 255})).image,
              {low, low, low, 1, 1, 1});
  // Alpha is dropped, whatever it is.
  expect_near(decode_light_image(make_png({1, 2, 8, 4}, {51, 0, 255, 128})).image,
              {low, low, low, 1, 1, 1});
  expect_near(decode_light_image(make_png({1, 1, 8, 6}, {0, 51, 255, 0})).image, {0, low, 1});
  PngRecipe palette{4, 1, 2, 3};
  palette.palette = {0, 0, 0, 255, 0, 0, 0, 51, 0, 128, 128, 255};
  palette.transparency = {255, 0};
  expect_near(decode_light_image(make_png(palette, {0b00'01'10'11})).image,
              {0, 0, 0, 1, 0, 0, 0, low, 0, mid, mid, 1});
  expect_near(decode_light_image(make_png({4, 1, 1, 0}, {0b10010000})).image,
              {1, 1, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1});
}

// Two codes of 16 bits that share their upper 8 are told apart.
TEST(PngAsLight, KeepsAllSixteenBits) {
  const DecodedImage decoded =
      decode_light_image(make_png({2, 1, 16, 2}, {0x80, 0x00, 0x80, 0xff, 0xff, 0xff,  //
                                                  0x00, 0x01, 0x00, 0x00, 0x12, 0x34}));
  EXPECT_EQ(decoded.format, "PNG, 16-bit sRGB");
  expect_near(decoded.image, {linear(0x8000 / 65535.0), linear(0x80ff / 65535.0), 1,
                              linear(1 / 65535.0), 0, linear(0x1234 / 65535.0)});
  EXPECT_LT(decoded.image.pixels[0], decoded.image.pixels[1]);
}

TEST(PngAsLight, RefusesAnotherEncodingThanSrgb) {
  PngRecipe recipe{1, 1, 8, 0};
  recipe.gamma = 100000;
  EXPECT_REFUSED(decode_light_image(make_png(recipe, {128})), unsupported, "gamma of 100000");
  recipe.srgb_chunk = true;  // overrides gAMA
  EXPECT_EQ(decode_light_image(make_png(recipe, {255})).image.pixels[0], 1);
  recipe = {1, 1, 8, 0};
  recipe.gamma = 45455;
  EXPECT_EQ(decode_light_image(make_png(recipe, {255})).image.pixels[0], 1);
}

TEST(JpegAsLight, IsReadAsSrgb) {
  Image8 picture = pattern8(48, 32, 3);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = static_cast<uint8_t>(i % 3 == 0 ? 200 : i % 3 == 1 ? 100 : 50);
  const DecodedImage decoded = decode_light_image(make_jpeg(picture));
  EXPECT_EQ(decoded.format, "JPEG, 8-bit sRGB");
  EXPECT_TRUE(decoded.display_referred);
  ASSERT_EQ(decoded.image.channels, 3);
  const double expected[3] = {linear(200 / 255.0), linear(100 / 255.0), linear(50 / 255.0)};
  for (size_t i = 0; i < decoded.image.pixels.size(); ++i)
    ASSERT_NEAR(decoded.image.pixels[i], expected[i % 3], 0.02) << i;
}

TEST(JpegAsLight, RefusesColoursForPrinting) {
  auto bytes = make_jpeg(pattern8(24, 24, 3));
  const std::byte frame[] = {std::byte{0xff}, std::byte{0xc0}};
  auto at = std::search(bytes.begin(), bytes.end(), frame, frame + 2);
  ASSERT_NE(at, bytes.end());
  *(at + 9) = std::byte{4};  // the number of components
  EXPECT_REFUSED(decode_light_image(bytes), unsupported, "CMYK");
}

TEST(Light, IsReadFromEveryFormatAndNothingElse) {
  const Image image = ramp(12, 6, 3);
  EXPECT_FALSE(decode_light_image(write_exr(image, {})).display_referred);
  EXPECT_FALSE(decode_light_image(write_radiance_hdr(image)).display_referred);
  EXPECT_REFUSED(decode_light_image({}), invalid_input, "an empty file");
  const std::byte glb[] = {std::byte{'g'}, std::byte{'l'}, std::byte{'T'}, std::byte{'F'}};
  EXPECT_REFUSED(decode_light_image(glb), invalid_input, "PNG or JPEG; this is a GLB scene");
}

// A picture of 8 x 4 of which the file holds the part from (2, 1) on, 5 x 3 pixels.
TEST(DisplayWindow, PutsACroppedPictureBackInPlace) {
  const Image part = ramp(5, 3, 3);
  ExrRecipe recipe;
  recipe.samples = test::ExrSamples::float32;
  recipe.window_x = 102;
  recipe.window_y = -49;
  recipe.display = PixelWindow{-2, -1, 8, 4};
  const DecodedImage decoded = decode_light_image(make_exr(part, recipe));
  ASSERT_EQ(decoded.image.width, 8);
  ASSERT_EQ(decoded.image.height, 4);
  EXPECT_EQ(decoded.pixels_missing, 32u - 15u);
  EXPECT_EQ(decoded.pixels_outside, 0u);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      const bool held = x >= 2 && x < 7 && y >= 1 && y < 4;
      EXPECT_EQ(decoded.image.rgb(x, y), held ? part.rgb(x - 2, y - 1) : Vec3{}) << x << ' ' << y;
    }
  }
}

TEST(DisplayWindow, DropsWhatLiesOutsideThePicture) {
  const Image large = ramp(10, 6, 1);
  ExrRecipe recipe;
  recipe.samples = test::ExrSamples::float32;
  recipe.display = PixelWindow{1, 1, 8, 4};
  const DecodedImage decoded = decode_light_image(make_exr(large, recipe));
  EXPECT_EQ(decoded.pixels_missing, 0u);
  EXPECT_EQ(decoded.pixels_outside, 60u - 32u);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x)
      EXPECT_EQ(decoded.image.rgb(x, y), large.rgb(x + 1, y + 1)) << x << ' ' << y;
}

// OpenEXR's standard for environment maps speaks of the data window alone.
TEST(DisplayWindow, MeansNothingWhereTheFileSaysThatItIsAMap) {
  const Image map = ramp(8, 4, 3);
  ExrRecipe recipe;
  recipe.samples = test::ExrSamples::float32;
  recipe.display = PixelWindow{-2, -1, 20, 10};
  recipe.envmap_latlong = true;
  const DecodedImage decoded = decode_light_image(make_exr(map, recipe));
  EXPECT_EQ(decoded.image.pixels, map.pixels);
  EXPECT_EQ(decoded.pixels_missing, 0u);
}

TEST(DisplayWindow, IsRefusedWhenItHoldsNothingOrIsAbsurd) {
  ExrRecipe recipe;
  recipe.display = PixelWindow{8, 0, 8, 4};
  EXPECT_REFUSED(decode_light_image(make_exr(ramp(8, 4, 3), recipe)), invalid_input,
                 "no pixel of its display window");
  recipe.display = PixelWindow{0, 0, 1'000'000, 4};
  EXPECT_REFUSED(decode_light_image(make_exr(ramp(8, 4, 3), recipe)), too_large,
                 "display window of an OpenEXR image of 1000000 x 4");
}

TEST(DisplayWindow, OfPublishedFilesIsHonoured) {
  LIGHTKILN_NEEDS_DATA(data);
  const DecodedImage t03 = decode_light_image(test::read_file(data / "exr_decoding/t03.exr"));
  EXPECT_EQ(t03.image.width, 370);
  EXPECT_EQ(t03.image.height, 280);
  EXPECT_EQ(t03.pixels_outside, 400u * 300u - 370u * 280u);
  EXPECT_REFUSED(decode_light_image(test::read_file(data / "exr_decoding/t09.exr")), invalid_input,
                 "display window");
}

}  // namespace
}  // namespace lightkiln
