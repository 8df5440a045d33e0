#include "core/image/exr.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/image/primaries.h"
#include "tests/image/exr_files.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

using test::ExrRecipe;
using test::ExrSamples;
using test::ExrStorage;
using test::make_exr;
using test::ramp;

// The largest difference, relative to the larger of the true value and 1.
double worst_difference(const Image& got, const Image& expected) {
  EXPECT_EQ(got.width, expected.width);
  EXPECT_EQ(got.height, expected.height);
  double worst = 0;
  for (int y = 0; y < expected.height; ++y) {
    for (int x = 0; x < expected.width; ++x) {
      const Vec3 a = got.rgb(x, y), b = expected.rgb(x, y);
      for (int c = 0; c < 3; ++c) {
        worst = std::max(
            worst, std::abs(double{a[c]} - double{b[c]}) / std::max(1.0, std::abs(double{b[c]})));
      }
    }
  }
  return worst;
}

// What each compression may change, given 16-bit samples, which themselves round by 2^-11. B44 and
// DWA are lossy: B44 keeps 6 bits of difference in each block of 4 x 4, DWA what level 45 keeps.
struct CompressionCase {
  const char* name;
  double tolerance;
};
constexpr double kHalfStep = 0x1p-11;
constexpr CompressionCase kCompressions[] = {
    {"none", kHalfStep}, {"rle", kHalfStep},   {"zips", kHalfStep}, {"zip", kHalfStep},
    {"piz", kHalfStep},  {"pxr24", kHalfStep}, {"b44", 0.02},       {"b44a", 0.02},
    {"dwaa", 0.02},      {"dwab", 0.02}};

class ExrCompression : public testing::TestWithParam<CompressionCase> {};
INSTANTIATE_TEST_SUITE_P(Every, ExrCompression, testing::ValuesIn(kCompressions),
                         [](const auto& param) { return std::string(param.param.name); });

TEST_P(ExrCompression, IsReadInEveryStorage) {
  const Image image = ramp(53, 37, 3);
  for (const auto storage :
       {ExrStorage::scan_lines, ExrStorage::tiles, ExrStorage::mip_map, ExrStorage::rip_map}) {
    ExrRecipe recipe;
    recipe.compression = GetParam().name;
    recipe.storage = storage;
    const DecodedImage decoded = read_exr(make_exr(image, recipe));
    EXPECT_EQ(decoded.image.channels, 3);
    EXPECT_LE(worst_difference(decoded.image, image), GetParam().tolerance)
        << "storage " << static_cast<int>(storage);
  }
}

TEST(Exr, ReadsFloatsExactlyAndIntegersAsNumbers) {
  const Image image = ramp(20, 11, 3);
  ExrRecipe recipe;
  recipe.samples = ExrSamples::float32;
  EXPECT_EQ(read_exr(make_exr(image, recipe)).image.pixels, image.pixels);
  recipe.samples = ExrSamples::uint32;
  Image whole = image;
  for (float& value : whole.pixels) value = std::floor(value);
  EXPECT_EQ(read_exr(make_exr(whole, recipe)).image.pixels, whole.pixels);
}

TEST(Exr, ReadsAnyDataWindowAndLineOrder) {
  const Image image = ramp(40, 70, 3);
  for (const auto& [x, y] : {std::pair{-1000, -37}, {0, 0}, {517, 100'000}}) {
    for (const bool decreasing : {false, true}) {
      ExrRecipe recipe;
      recipe.window_x = x;
      recipe.window_y = y;
      recipe.decreasing_lines = decreasing;
      EXPECT_LE(worst_difference(read_exr(make_exr(image, recipe)).image, image), kHalfStep)
          << x << ", " << y;
    }
  }
}

TEST(Exr, ReadsImagesTallerThanOneReadingStep) {
  const Image image = ramp(3, 700, 3);
  ExrRecipe recipe;
  EXPECT_LE(worst_difference(read_exr(make_exr(image, recipe)).image, image), kHalfStep);
  recipe.storage = ExrStorage::tiles;
  EXPECT_LE(worst_difference(read_exr(make_exr(image, recipe)).image, image), kHalfStep);
}

TEST(Exr, ReadsTheFirstPartThatHoldsColor) {
  const Image image = ramp(24, 18, 3);
  ExrRecipe recipe;
  recipe.second_part = true;
  EXPECT_LE(worst_difference(read_exr(make_exr(image, recipe)).image, image), kHalfStep);
}

TEST(Exr, DropsAlphaAndForeignChannels) {
  const Image image = ramp(9, 9, 4);
  ExrRecipe recipe;
  recipe.extra_channels = {"Z", "diffuse.R", "Y"};
  const DecodedImage decoded = read_exr(make_exr(image, recipe));
  EXPECT_EQ(decoded.image.channels, 3);
  EXPECT_LE(worst_difference(decoded.image, image), kHalfStep);
}

TEST(Exr, ReadsLuminanceAloneAsOneChannel) {
  const Image image = ramp(9, 5, 1);
  const DecodedImage decoded = read_exr(make_exr(image, {}));
  EXPECT_EQ(decoded.image.channels, 1);
  EXPECT_LE(worst_difference(decoded.image, image), kHalfStep);
}

// One colour at varying brightness has constant chroma, which any reconstruction restores.
TEST(Exr, ReconstructsLuminanceChroma) {
  Image image(64, 48, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float light = 0.5f + static_cast<float>(x % 7) + 0.1f * static_cast<float>(y);
      image.at(x, y)[0] = 0.8f * light;
      image.at(x, y)[1] = 0.5f * light;
      image.at(x, y)[2] = 0.3f * light;
    }
  }
  const DecodedImage decoded = read_exr(test::make_luminance_chroma_exr(image));
  EXPECT_EQ(decoded.image.channels, 3);
  // Y, RY and BY are rounded to half, and green is the difference of the three.
  EXPECT_LE(worst_difference(decoded.image, image), 6 * kHalfStep);
}

TEST(Exr, ConvertsChromaticitiesAndKeepsWhite) {
  // Display P3 against the published matrix to sRGB (CSS Color 4, sample code).
  Primaries p3;
  p3.red = {0.680, 0.320};
  p3.green = {0.265, 0.690};
  Image image(4, 1, 3);
  for (int c = 0; c < 3; ++c) image.at(c, 0)[c] = 1;
  for (int c = 0; c < 3; ++c) image.at(3, 0)[c] = 1;
  ExrRecipe recipe;
  recipe.samples = ExrSamples::float32;
  recipe.primaries = p3;
  const Image got = read_exr(make_exr(image, recipe)).image;
  const double expected[4][3] = {{1.2249402, -0.0420570, -0.0196376},
                                 {-0.2249402, 1.0420570, -0.0786361},
                                 {0, 0, 1.0982736},
                                 {1, 1, 1}};
  for (int x = 0; x < 4; ++x)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(got.at(x, 0)[c], expected[x][c], 2e-4) << x << c;
}

TEST(Exr, KeepsWhiteUnderAnotherWhitePoint) {
  Primaries warm;
  warm.white = {0.3457, 0.3585};
  Image image(1, 1, 3);
  image.pixels = {2, 2, 2};
  ExrRecipe recipe;
  recipe.samples = ExrSamples::float32;
  recipe.primaries = warm;
  for (const float value : read_exr(make_exr(image, recipe)).image.pixels)
    EXPECT_NEAR(value, 2, 1e-6);
}

TEST(Exr, LeavesRec709Untouched) {
  const Image image = ramp(16, 16, 3);
  ExrRecipe recipe;
  recipe.samples = ExrSamples::float32;
  recipe.primaries = Primaries{};
  EXPECT_EQ(read_exr(make_exr(image, recipe)).image.pixels, image.pixels);
}

TEST(Exr, RefusesPrimariesThatSpanNothing) {
  ExrRecipe recipe;
  recipe.primaries = Primaries{{0.3, 0.3}, {0.3, 0.3}, {0.3, 0.3}, {0.3, 0.3}};
  EXPECT_REFUSED(read_exr(make_exr(ramp(4, 4, 3), recipe)), invalid_input, "primaries");
}

TEST(Exr, WritesWhatItReads) {
  for (const int channels : {1, 3}) {
    for (const auto type : {ExrPixelType::half, ExrPixelType::float32}) {
      const Image image = ramp(33, 21, channels);
      ExrWriteOptions options;
      options.pixel_type = type;
      options.envmap = EnvmapAttribute::latlong;
      const DecodedImage decoded = read_exr(write_exr(image, options));
      EXPECT_EQ(decoded.image.channels, channels);
      EXPECT_EQ(decoded.envmap, EnvmapAttribute::latlong);
      EXPECT_LE(worst_difference(decoded.image, image),
                type == ExrPixelType::half ? kHalfStep : 0.0);
    }
  }
}

TEST(Exr, NamesTheFormatThatItRead) {
  EXPECT_EQ(read_exr(make_exr(ramp(4, 4, 3), {})).format, "OpenEXR, 16-bit float, ZIP");
  ExrRecipe recipe;
  recipe.compression = "dwab";
  recipe.samples = ExrSamples::float32;
  recipe.storage = ExrStorage::tiles;
  EXPECT_EQ(read_exr(make_exr(ramp(4, 4, 3), recipe)).format, "OpenEXR, 32-bit float, DWAB, tiled");
}

TEST(Exr, TellsATextAttributeByItsName) {
  ExrWriteOptions options;
  options.attributes = {{"lightkiln.layout", "cube"}};
  const std::vector<std::byte> file = write_exr(Image(2, 2, 3), options);
  EXPECT_EQ(exr_text(file, "lightkiln.layout"), "cube");
  EXPECT_EQ(exr_text(file, "lightkiln.other"), "");
  EXPECT_EQ(exr_text(file, "compression"), "");  // stands there, but is no text
  EXPECT_EQ(exr_text(std::vector<std::byte>(100), "lightkiln.layout"), "");
  EXPECT_REFUSED(exr_text(std::span(file).first(40), "lightkiln.layout"), invalid_input, "OpenEXR");
}

TEST(Exr, EqualPixelsGiveEqualBytes) {
  ExrWriteOptions options;
  options.attributes = {{"lightkiln:job", "42"}, {"comments", "one line"}};
  const Image image = ramp(64, 64, 3);
  const auto first = write_exr(image, options);
  EXPECT_EQ(first, write_exr(image, options));
  options.attributes["lightkiln:job"] = "43";
  EXPECT_NE(first, write_exr(image, options));
  const std::string text(reinterpret_cast<const char*>(first.data()), first.size());
  for (const char* part : {"lightkiln:job", "comments", "one line", "chromaticities"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
}

// E3: The values around the largest half.
TEST(Exr, FallsBackToFloatRatherThanOverflow) {
  for (const float top : {65504.0f, 65519.0f, 65520.0f, 1e6f}) {
    Image image = ramp(8, 8, 3);
    image.pixels[5] = top;
    ExrPixelType written{};
    const DecodedImage decoded = read_exr(write_exr(image, {}, &written));
    EXPECT_EQ(written, top > 65504 ? ExrPixelType::float32 : ExrPixelType::half) << top;
    for (const float value : decoded.image.pixels) ASSERT_TRUE(std::isfinite(value)) << top;
    EXPECT_EQ(decoded.image.pixels[5], top);
    if (written == ExrPixelType::float32) {
      EXPECT_EQ(decoded.image.pixels, image.pixels);
    } else {
      EXPECT_LE(worst_difference(decoded.image, image), kHalfStep);
    }
  }
}

// The control of the test above: the library alone turns 65520 into infinity.
TEST(Exr, HalfWithoutTheFallbackOverflows) {
  Image image = ramp(8, 8, 3);
  image.pixels[5] = 65520;
  EXPECT_TRUE(std::isinf(read_exr(make_exr(image, {})).image.pixels[5]));
}

TEST(Exr, ReturnsNonFiniteValuesAsStored) {
  Image image = ramp(4, 4, 3);
  image.pixels[0] = std::numeric_limits<float>::quiet_NaN();
  image.pixels[1] = std::numeric_limits<float>::infinity();
  image.pixels[2] = -3;
  const Image got = read_exr(make_exr(image, {})).image;
  EXPECT_TRUE(std::isnan(got.pixels[0]));
  EXPECT_TRUE(std::isinf(got.pixels[1]));
  EXPECT_EQ(got.pixels[2], -3);
}

TEST(Exr, RefusesDeepImagesByName) {
  auto bytes = make_exr(ramp(4, 4, 3), {});
  bytes[5] |= std::byte{0x08};
  EXPECT_REFUSED(read_exr(bytes), unsupported, "deep");
}

TEST(Exr, RefusesUnknownChannelsAndListsThem) {
  ExrRecipe recipe;
  recipe.extra_channels = {"diffuse.R", "Z"};
  Image image = ramp(4, 4, 1);
  auto bytes = make_exr(image, recipe);
  // Rename Y, so that no colour is left.
  const char channel[] = "Y\0\1\0\0\0";
  auto at = std::search(bytes.begin(), bytes.end(), reinterpret_cast<const std::byte*>(channel),
                        reinterpret_cast<const std::byte*>(channel) + 6);
  ASSERT_NE(at, bytes.end());
  *at = std::byte{'U'};
  EXPECT_REFUSED(read_exr(bytes), unsupported, "U, Z, diffuse.R");
}

TEST(Exr, RefusesEveryTruncation) {
  for (const char* compression : {"none", "rle", "zip", "piz", "dwaa"}) {
    for (const auto storage : {ExrStorage::scan_lines, ExrStorage::tiles}) {
      ExrRecipe recipe;
      recipe.compression = compression;
      recipe.storage = storage;
      const auto bytes = make_exr(ramp(40, 40, 3), recipe);
      for (size_t keep = 0; keep < bytes.size(); keep += 1 + bytes.size() / 97) {
        EXPECT_REFUSED(read_exr(std::span(bytes).first(keep)), invalid_input, "");
      }
      EXPECT_REFUSED(read_exr(std::span(bytes).first(bytes.size() - 1)), invalid_input, "");
    }
  }
}

// The place of the block offset table: before the first block, one offset of 8 bytes a block.
size_t first_offset_at(const std::vector<std::byte>& bytes, size_t blocks) {
  for (size_t at = 8; at + 8 <= bytes.size(); ++at) {
    uint64_t offset = 0;
    std::memcpy(&offset, &bytes[at], 8);
    if (offset == at + 8 * blocks) return at;
  }
  ADD_FAILURE() << "no offset table";
  return 0;
}

TEST(Exr, RefusesMissingBlocksInsteadOfFillingThemWithBlack) {
  auto bytes = make_exr(ramp(40, 64, 3), {});  // ZIP: four blocks of 16 rows
  const size_t table = first_offset_at(bytes, 4);
  std::memset(&bytes[table + 16], 0, 8);
  EXPECT_REFUSED(read_exr(bytes), invalid_input, "incomplete");
}

// The library alone fills the rest of such a block with what its buffer held before.
TEST(Exr, RefusesBlocksThatHoldTooFewBytes) {
  for (const char* compression : {"none", "rle", "zips", "zip"}) {
    ExrRecipe recipe;
    recipe.compression = compression;
    auto bytes = make_exr(ramp(64, 1, 3), recipe);  // one block, at the file's end
    const size_t block = first_offset_at(bytes, 1) + 8;
    uint32_t size = 0;
    std::memcpy(&size, &bytes[block + 4], 4);
    ASSERT_EQ(block + 8 + size, bytes.size());
    size -= 2;
    std::memcpy(&bytes[block + 4], &size, 4);
    bytes.resize(bytes.size() - 2);
    EXPECT_REFUSED(read_exr(bytes), invalid_input, "row 0 is damaged or too short");
  }
}

// Finds the data window by its attribute name and type, and sets its far corner.
void claim_size(std::vector<std::byte>& bytes, int width, int height) {
  const std::string name("dataWindow\0box2i\0", 17);
  const auto* text = reinterpret_cast<const std::byte*>(name.data());
  const auto at = std::search(bytes.begin(), bytes.end(), text, text + name.size());
  ASSERT_NE(at, bytes.end());
  const int corner[2] = {width - 1, height - 1};
  std::memcpy(&*at + name.size() + 4 + 8, corner, sizeof corner);
}

TEST(Exr, RefusesSizesAboveTheLimits) {
  for (const auto& [width, height] : {std::pair{16385, 2}, {2, 16385}, {16384, 8192}}) {
    auto bytes = make_exr(ramp(4, 4, 3), {});
    claim_size(bytes, width, height);
    bytes.resize(200'000);  // room for the offset table
    EXPECT_REFUSED(read_exr(bytes), too_large, "16384 a side and 67108864");
  }
}

TEST(Exr, RefusesLargeClaimsOfSmallFiles) {
  for (const auto& [width, height] : {std::pair{8192, 8192}, {16384, 16}, {2'000'000'000, 3}}) {
    for (const auto storage : {ExrStorage::scan_lines, ExrStorage::tiles}) {
      ExrRecipe recipe;
      recipe.storage = storage;
      auto bytes = make_exr(ramp(4, 4, 3), recipe);
      claim_size(bytes, width, height);
      EXPECT_REFUSED(read_exr(bytes), invalid_input, "");
    }
  }
}

TEST(Exr, RefusesToWriteWhatItWouldNotRead) {
  EXPECT_REFUSED(write_exr(Image(16385, 1, 1), {}), too_large, "16384");
  EXPECT_REFUSED(write_exr(Image(0, 4, 3), {}), invalid_input, "nothing in it");
}

TEST(Exr, ReadsOneByOne) {
  Image image(1, 1, 3);
  image.pixels = {1, 2, 3};
  EXPECT_EQ(read_exr(write_exr(image, {})).image.pixels, image.pixels);
}

}  // namespace
}  // namespace lightkiln
