#include "core/image/radiance_hdr.h"

#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "tests/image/exr_files.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

std::vector<std::byte> as_bytes(const std::string& text) {
  std::vector<std::byte> bytes;
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
  return bytes;
}

// A whole file from header lines, resolution and pixel data.
std::vector<std::byte> file(const std::string& lines, const std::string& resolution,
                            const std::string& data) {
  return as_bytes("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n" + lines + "\n" + resolution + "\n" + data);
}

// A pixel of red `value`: exponent 136 makes the mantissa the value.
std::string red(int value) {
  return std::string{static_cast<char>(value), 0, 0, static_cast<char>(136)};
}
std::string repeat(int count) {
  return std::string{1, 1, 1, static_cast<char>(count)};
}

std::vector<float> reds(const Image& image) {
  std::vector<float> values;
  for (size_t i = 0; i < image.pixels.size(); i += 3) values.push_back(image.pixels[i]);
  return values;
}

TEST(RadianceHdr, ReadsFlatPixels) {
  const Image image =
      read_radiance_hdr(file("", "-Y 2 +X 3", red(1) + red(2) + red(3) + red(4) + red(5) + red(6)))
          .image;
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(reds(image), (std::vector<float>{1, 2, 3, 4, 5, 6}));
}

TEST(RadianceHdr, ReadsOldRuns) {
  const Image image =
      read_radiance_hdr(file("", "-Y 1 +X 9", red(7) + repeat(5) + red(8) + repeat(2))).image;
  EXPECT_EQ(reds(image), (std::vector<float>{7, 7, 7, 7, 7, 7, 8, 8, 8}));
}

TEST(RadianceHdr, ReadsOldRunsLongerThanAByte) {
  const Image image =
      read_radiance_hdr(file("", "-Y 1 +X 260", red(7) + repeat(2) + repeat(1) + red(8))).image;
  EXPECT_EQ(image.pixels[3 * 258], 7);
  EXPECT_EQ(image.pixels[3 * 259], 8);
}

TEST(RadianceHdr, ReadsNewRuns) {
  // Red: 3 x 10 by a run, then 1..5 copied; green, blue: 8 x 0; exponent: 8 x 136.
  const std::string line = std::string{2, 2, 0, 8} + std::string{static_cast<char>(131), 10} +
                           std::string{5, 1, 2, 3, 4, 5} +
                           std::string{static_cast<char>(136), 0, static_cast<char>(136), 0} +
                           std::string{static_cast<char>(136), static_cast<char>(136)};
  const Image image = read_radiance_hdr(file("", "-Y 1 +X 8", line)).image;
  EXPECT_EQ(reds(image), (std::vector<float>{10, 10, 10, 1, 2, 3, 4, 5}));
}

// Radiance's own words: the first axis is the one from scan line to scan line, + and - are the
// directions in which X grows to the right and Y upwards.
TEST(RadianceHdr, ReadsAllEightOrientations) {
  const std::string data = red(1) + red(2) + red(3) + red(4) + red(5) + red(6);
  const struct {
    const char* resolution;
    int width, height;
    std::vector<float> expected;  // top row first
  } cases[] = {
      {"-Y 2 +X 3", 3, 2, {1, 2, 3, 4, 5, 6}}, {"-Y 2 -X 3", 3, 2, {3, 2, 1, 6, 5, 4}},
      {"+Y 2 -X 3", 3, 2, {6, 5, 4, 3, 2, 1}}, {"+Y 2 +X 3", 3, 2, {4, 5, 6, 1, 2, 3}},
      {"+X 2 -Y 3", 2, 3, {1, 4, 2, 5, 3, 6}}, {"-X 2 -Y 3", 2, 3, {4, 1, 5, 2, 6, 3}},
      {"-X 2 +Y 3", 2, 3, {6, 3, 5, 2, 4, 1}}, {"+X 2 +Y 3", 2, 3, {3, 6, 2, 5, 1, 4}},
  };
  for (const auto& c : cases) {
    const Image image = read_radiance_hdr(file("", c.resolution, data)).image;
    EXPECT_EQ(image.width, c.width) << c.resolution;
    EXPECT_EQ(image.height, c.height) << c.resolution;
    EXPECT_EQ(reds(image), c.expected) << c.resolution;
  }
}

TEST(RadianceHdr, DividesByEveryExposure) {
  const Image image =
      read_radiance_hdr(file("EXPOSURE=2\nCOLORCORR= 1 2 4\nEXPOSURE=4\n", "-Y 1 +X 1",
                             std::string{64, 64, 64, static_cast<char>(136)}))
          .image;
  EXPECT_EQ(image.pixels, (std::vector<float>{8, 4, 2}));
}

TEST(RadianceHdr, ConvertsStatedPrimariesAndPassesOverZeros) {
  const std::string pixel = red(100);
  const auto converted = [&](const std::string& primaries) {
    return read_radiance_hdr(file("PRIMARIES=" + primaries + "\n", "-Y 1 +X 1", pixel)).image;
  };
  EXPECT_EQ(converted("0 0 0 0 0 0 0 0").pixels, (std::vector<float>{100, 0, 0}));
  EXPECT_EQ(converted("0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329").pixels,
            (std::vector<float>{100, 0, 0}));
  // Display P3: the published matrix again.
  EXPECT_NEAR(converted("0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329").pixels[0], 122.494, 0.02);
}

TEST(RadianceHdr, RefusesWhatIsNotWellFormed) {
  const auto refuses = [](const std::vector<std::byte>& bytes, const char* part) {
    EXPECT_REFUSED(read_radiance_hdr(bytes), invalid_input, part);
  };
  const std::string e(1, static_cast<char>(136));
  refuses(as_bytes(""), "header");
  refuses(as_bytes("P6\n"), "signature");
  refuses(as_bytes("#?RADIANCE\n"), "header does not end");
  refuses(file("", "-Y 2 +Z 3", ""), "resolution");
  refuses(file("", "-Y 2 +Y 3", ""), "resolution");
  refuses(file("", "-Y 99999999999 +X 3", ""), "resolution");
  refuses(file("", "-Y 0 +X 3", ""), "nothing in it");
  refuses(file("", "-Y -5 +X 3", ""), "nothing in it");
  refuses(file("EXPOSURE=0\n", "-Y 1 +X 1", red(1)), "exposure");
  refuses(file("EXPOSURE=nan\n", "-Y 1 +X 1", red(1)), "exposure");
  refuses(file("EXPOSURE=1e38\n", "-Y 1 +X 1", red(1)), "between 1e-30 and 1e30");
  refuses(file("COLORCORR=1 2\n", "-Y 1 +X 1", red(1)), "exposure");
  refuses(file("PRIMARIES=1 2 3\n", "-Y 1 +X 1", red(1)), "primaries");
  refuses(file("", "-Y 1 +X 9", repeat(9)), "begins with a repetition");
  refuses(file("", "-Y 1 +X 9", red(7) + repeat(9)), "past the end");
  refuses(file("", "-Y 1 +X 9", red(7) + repeat(0) + repeat(0) + repeat(0) + repeat(0) + repeat(1)),
          "past the end");
  refuses(file("", "-Y 1 +X 8", std::string{2, 2, 0, 9} + std::string(16, 1)), "another length");
  refuses(file("", "-Y 1 +X 8", std::string{2, 2, 0, 8, 0} + std::string(16, 1)), "no pixels");
  refuses(file("", "-Y 1 +X 8", std::string{2, 2, 0, 8, 9} + std::string(16, 1)), "past the end");
}

TEST(RadianceHdr, RefusesOtherColorFormatsAndSizes) {
  auto xyze = as_bytes("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd");
  EXPECT_REFUSED(read_radiance_hdr(xyze), unsupported, "xyze");
  EXPECT_REFUSED(read_radiance_hdr(file("", "-Y 16385 +X 1", "")), too_large, "16384");
  EXPECT_REFUSED(read_radiance_hdr(file("", "-Y 16384 +X 16384", "")), too_large, "67108864");
  // A file of a few bytes that claims all that is allowed.
  EXPECT_REFUSED(read_radiance_hdr(file("", "-Y 16384 +X 4096", red(1))), invalid_input,
                 "ends too early");
}

TEST(RadianceHdr, RefusesEveryTruncation) {
  for (const int width : {5, 60}) {
    const auto bytes = write_radiance_hdr(test::ramp(width, 4, 3));
    for (size_t keep = 0; keep < bytes.size(); ++keep)
      EXPECT_REFUSED(read_radiance_hdr(std::span(bytes).first(keep)), invalid_input, "");
  }
}

// The shared exponent allows 1/128 of the largest channel; rounding to nearest halves that.
TEST(RadianceHdr, WritesWithinHalfAStepOfTheLargestChannel) {
  for (const int width : {1, 7, 8, 127, 128, 129, 400}) {
    Image image = test::ramp(width, 3, 3);
    for (size_t i = 0; i < image.pixels.size(); ++i)
      image.pixels[i] *= std::ldexp(1.0f, static_cast<int>(i * 7 % 90) / 3 - 15);
    image.pixels[0] = 1e6f;
    image.pixels[4] = 0.99999994f;  // rounds up to the next exponent
    const Image got = read_radiance_hdr(write_radiance_hdr(image)).image;
    ASSERT_EQ(got.pixels.size(), image.pixels.size());
    for (size_t i = 0; i < got.pixels.size(); ++i) {
      const float* pixel = &image.pixels[i - i % 3];
      const float largest = std::max({pixel[0], pixel[1], pixel[2]});
      ASSERT_NEAR(got.pixels[i], image.pixels[i], largest / 256) << width << ": " << i;
    }
  }
}

TEST(RadianceHdr, WritesTheEndsOfItsRange) {
  Image image(9, 1, 3);
  image.pixels = {0, 0, 0, 1e-38f, 0, 0, 1e-39f, 0, 0, 8e37f, 1, 0, 1, 1,
                  1, 1, 1, 1,      1, 1, 1,      2, 2, 2,     3, 3, 3};
  const Image got = read_radiance_hdr(write_radiance_hdr(image)).image;
  EXPECT_EQ(got.pixels[0], 0);
  EXPECT_NEAR(got.pixels[3] / 1e-38f, 1, 1.0 / 128);
  EXPECT_LE(got.pixels[6], 2e-39f);
  EXPECT_NEAR(got.pixels[9] / 8e37f, 1, 1.0 / 128);
  for (const float bad : {-1.0f, 1e38f, std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::quiet_NaN()}) {
    image.pixels[7] = bad;
    EXPECT_REFUSED(write_radiance_hdr(image), invalid_input, "at pixel 2, 0");
  }
}

TEST(RadianceHdr, PacksConstantImages) {
  Image image(1024, 16, 3);
  for (float& value : image.pixels) value = 0.5f;
  EXPECT_LT(write_radiance_hdr(image).size(), 2000u);
}

}  // namespace
}  // namespace lightkiln
