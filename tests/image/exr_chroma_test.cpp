// Luminance and subsampled chroma (Y, RY, BY) in a part of a multi-part file: what is read of it is
// what is read of the same picture in a file of its own.

#include <cstring>
#include <string_view>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "tests/image/exr_files.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

using test::ChromaRecipe;
using test::make_luminance_chroma_exr;

// Ramps of another slope in each channel, crossed by hard edges of another colour.
Image colourful(int width, int height) {
  Image image = test::ramp(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if ((x / 5 + y / 7) % 2 == 0) std::swap(image.at(x, y)[0], image.at(x, y)[2]);
    }
  }
  return image;
}

TEST(ExrChroma, IsReadInAPartAsInAFileOfItsOwn) {
  const Image image = colourful(70, 94);
  for (const char* compression : {"none", "rle", "zips", "zip", "piz", "pxr24", "b44", "dwab"}) {
    ChromaRecipe recipe;
    recipe.compression = compression;
    const DecodedImage alone = read_exr(make_luminance_chroma_exr(image, recipe));
    recipe.second_part = true;
    const DecodedImage part = read_exr(make_luminance_chroma_exr(image, recipe));
    EXPECT_EQ(part.image.width, 70) << compression;
    EXPECT_EQ(part.image.channels, 3) << compression;
    EXPECT_EQ(part.image.pixels, alone.image.pixels) << compression;
    EXPECT_EQ(part.format, alone.format);
    EXPECT_NE(part.format.find("luminance/chroma"), std::string::npos) << part.format;
  }
}

TEST(ExrChroma, IsReadInADataWindowAnywhere) {
  const Image image = colourful(38, 46);
  const DecodedImage centred = read_exr(make_luminance_chroma_exr(image));
  for (const auto& [x, y] : {std::pair{-6, 10}, {4, -8}, {-1000, -2002}, {30000, 2}}) {
    ChromaRecipe recipe;
    recipe.window_x = x;
    recipe.window_y = y;
    recipe.second_part = true;
    const DecodedImage part = read_exr(make_luminance_chroma_exr(image, recipe));
    EXPECT_EQ(part.image.pixels, centred.image.pixels) << x << " " << y;
  }
}

// The colours themselves, not only their equality: where they change slowly, reconstruction
// restores them.
TEST(ExrChroma, GivesTheColoursOfThePicture) {
  const Image image = test::ramp(64, 48, 3);
  ChromaRecipe recipe;
  recipe.second_part = true;
  const Image got = read_exr(make_luminance_chroma_exr(image, recipe)).image;
  for (int y = 14; y < 34; ++y) {
    for (int x = 14; x < 50; ++x) {
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(got.at(x, y)[c], image.at(x, y)[c], 0.01f * image.at(x, y)[c]) << x << " " << y;
      }
    }
  }
}

// Overwrites the last data window among the file's headers: x and y of its corners.
std::vector<std::byte> with_window(std::vector<std::byte> bytes, const int32_t (&window)[4]) {
  constexpr std::string_view kName("dataWindow\0box2i\0", 17);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const size_t at = text.rfind(kName) + kName.size() + 4;
  std::memcpy(bytes.data() + at, window, sizeof window);
  return bytes;
}

// Every second pixel is not defined for them; the library refuses such a file in either form.
TEST(ExrChroma, RefusesWindowsWithOddCornersOrSides) {
  const Image image = colourful(38, 46);
  for (const bool second_part : {false, true}) {
    ChromaRecipe recipe;
    recipe.second_part = second_part;
    const auto bytes = make_luminance_chroma_exr(image, recipe);
    EXPECT_EQ(read_exr(with_window(bytes, {0, 0, 37, 45})).image.width, 38);
    EXPECT_REFUSED(read_exr(with_window(bytes, {1, 0, 38, 45})), invalid_input, "malformed");
    EXPECT_REFUSED(read_exr(with_window(bytes, {0, 3, 37, 48})), invalid_input, "malformed");
    EXPECT_REFUSED(read_exr(with_window(bytes, {0, 0, 36, 45})), invalid_input, "malformed");
    EXPECT_REFUSED(read_exr(with_window(bytes, {0, 0, 37, 44})), invalid_input, "malformed");
  }
}

TEST(ExrChroma, RefusesAPartThatIsCutShort) {
  ChromaRecipe recipe;
  recipe.second_part = true;
  std::vector<std::byte> bytes = make_luminance_chroma_exr(colourful(70, 94), recipe);
  bytes.resize(bytes.size() - 40);
  EXPECT_REFUSED(read_exr(bytes), invalid_input, "ends too early");
}

}  // namespace
}  // namespace lightkiln
