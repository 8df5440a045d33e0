// Mip-mapped files as we write them: every level back as it was, and readable by others.

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "tests/image/exr_files.h"
#include "tests/image/refusals.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;
using test::ramp;

// A strip of six faces in which every level has a value of its own plus a ramp.
std::vector<Image> cube_chain(int size, int levels, int channels) {
  std::vector<Image> chain;
  for (int level = 0; level < levels; ++level) {
    Image image = ramp(size >> level, 6 * (size >> level), channels);
    for (float& value : image.pixels) value += 8.0f * static_cast<float>(level);
    chain.push_back(std::move(image));
  }
  return chain;
}

TEST(ExrMipmap, ReturnsEveryLevelAsGiven) {
  for (const int channels : {1, 3}) {
    const std::vector<Image> chain = cube_chain(64, 5, channels);
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    const std::vector<Image> got = read_exr_levels(write_exr_mipmapped(chain, options));
    ASSERT_EQ(got.size(), 9u);  // 384 rows halve eight times
    for (size_t level = 0; level < chain.size(); ++level) {
      EXPECT_EQ(got[level].width, chain[level].width);
      EXPECT_EQ(got[level].pixels, chain[level].pixels) << level;
    }
    EXPECT_EQ(got.back().width, 1);
    EXPECT_EQ(got.back().height, 1);
  }
}

TEST(ExrMipmap, FillsTheLevelsThatWereNotGivenWithMeans) {
  std::vector<Image> chain = {Image(4, 2, 1)};
  chain[0].pixels = {1, 3, 5, 7, 9, 11, 13, 15};
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  const std::vector<Image> got = read_exr_levels(write_exr_mipmapped(chain, options));
  ASSERT_EQ(got.size(), 3u);
  EXPECT_EQ(got[1].pixels, (std::vector<float>{6, 10}));
  EXPECT_EQ(got[2].pixels, (std::vector<float>{8}));
  // Odd sides: a pixel counts by the area that falls to it. 5 columns become 2 of 2.5.
  chain = {Image(5, 1, 1)};
  chain[0].pixels = {1, 2, 3, 4, 5};
  const std::vector<Image> odd = read_exr_levels(write_exr_mipmapped(chain, options));
  ASSERT_EQ(odd.size(), 3u);
  EXPECT_FLOAT_EQ(odd[1].pixels[0], 4.5f / 2.5f);
  EXPECT_FLOAT_EQ(odd[1].pixels[1], 10.5f / 2.5f);
}

TEST(ExrMipmap, RoundsToHalfUnlessALevelHoldsMore) {
  std::vector<Image> chain = cube_chain(16, 3, 3);
  ExrPixelType written{};
  const std::vector<Image> half = read_exr_levels(write_exr_mipmapped(chain, {}, &written));
  EXPECT_EQ(written, ExrPixelType::half);
  for (size_t i = 0; i < chain[2].pixels.size(); ++i)
    EXPECT_NEAR(half[2].pixels[i], chain[2].pixels[i], 0x1p-11 * chain[2].pixels[i]);
  chain[2].pixels[7] = 1e6f;  // in the last level only
  const std::vector<Image> whole = read_exr_levels(write_exr_mipmapped(chain, {}, &written));
  EXPECT_EQ(written, ExrPixelType::float32);
  for (size_t level = 0; level < chain.size(); ++level)
    EXPECT_EQ(whole[level].pixels, chain[level].pixels) << level;
}

TEST(ExrMipmap, ReadsLevelZeroAsThePictureAndOneLevelOfOtherFiles) {
  const std::vector<Image> chain = cube_chain(32, 4, 3);
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  const DecodedImage decoded = read_exr(write_exr_mipmapped(chain, options));
  EXPECT_EQ(decoded.image.pixels, chain[0].pixels);
  EXPECT_EQ(decoded.format, "OpenEXR, 32-bit float, ZIP, tiled");
  EXPECT_EQ(read_exr_levels(write_exr(chain[1], options)).size(), 1u);
}

TEST(ExrMipmap, EqualPixelsGiveEqualBytes) {
  ExrWriteOptions options;
  options.attributes = {{"lightkiln.layout", "cube"}};
  EXPECT_EQ(write_exr_mipmapped(cube_chain(16, 2, 3), options),
            write_exr_mipmapped(cube_chain(16, 2, 3), options));
}

TEST(ExrMipmap, RefusesLevelsThatDoNotHalve) {
  EXPECT_REFUSED(write_exr_mipmapped({}, {}), invalid_input, "at least one level");
  std::vector<Image> chain = cube_chain(16, 3, 3);
  chain[2] = ramp(8, 48, 3);
  EXPECT_REFUSED(write_exr_mipmapped(chain, {}), invalid_input,
                 "Level 2 of a mip-mapped OpenEXR image is 8 x 48");
  chain[2] = ramp(4, 24, 1);
  EXPECT_REFUSED(write_exr_mipmapped(chain, {}), invalid_input, "of 1 channels");
  // A face of 3 cannot halve: level 1 of its strip would be 1 x 9, which is no strip of six.
  EXPECT_REFUSED(write_exr_mipmapped(std::vector<Image>{ramp(3, 18, 3), ramp(1, 6, 3)}, {}),
                 invalid_input, "1 x 9");
  EXPECT_REFUSED(write_exr_mipmapped(std::vector<Image>(3, ramp(1, 1, 3)), {}), invalid_input,
                 "at most 1 levels");
}

TEST(ExrMipmap, RefusesEveryTruncationOfALevel) {
  const auto bytes = write_exr_mipmapped(cube_chain(32, 4, 3), {});
  for (size_t keep = 0; keep < bytes.size(); keep += 1 + bytes.size() / 97) {
    EXPECT_REFUSED(read_exr_levels(std::span(bytes).first(keep)), invalid_input, "");
  }
}

std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  std::array<char, 4096> part{};
  while (pipe && fgets(part.data(), part.size(), pipe.get())) text += part.data();
  return text;
}

TEST(ExrMipmap, IsReadByIndependentPrograms) {
  if (std::system("command -v exrheader oiiotool >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "no exrheader or oiiotool to compare with";
  const fs::path path = fs::path(testing::TempDir()) / "lightkiln_mipmap.exr";
  std::vector<Image> chain;
  for (int level = 0; level < 4; ++level) {
    chain.emplace_back(32 >> level, 6 * (32 >> level), 3);
    for (size_t i = 0; i < chain.back().pixels.size(); ++i)
      chain.back().pixels[i] = static_cast<float>(level + 1) * 0.25f;
  }
  const auto bytes = write_exr_mipmapped(chain, {});
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  const std::string header = output_of("exrheader '" + path.string() + "' 2>&1");
  for (const char* part : {"mip-map", "tile size 64 by 64", "level sizes rounded down",
                           "lightkiln.levels", "\"tiledimage\""})
    EXPECT_NE(header.find(part), std::string::npos) << part << "\n" << header;
  for (int level = 0; level < 4; ++level) {
    const std::string stats = output_of("oiiotool '" + path.string() + "' --selectmip " +
                                        std::to_string(level) + " --printstats 2>&1");
    std::array<char, 64> average{};
    std::snprintf(average.data(), average.size(), "Stats Avg: %.6f %.6f %.6f", 0.25 * (level + 1),
                  0.25 * (level + 1), 0.25 * (level + 1));
    EXPECT_NE(stats.find(average.data()), std::string::npos) << average.data() << "\n" << stats;
  }
  fs::remove(path);
}

}  // namespace
}  // namespace lightkiln
