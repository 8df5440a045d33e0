// Files made by others, against figures measured by others (OpenImageIO).

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/image/decode.h"
#include "core/image/ldr.h"
#include "tests/image/refusals.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

struct RealFile {
  const char* path;
  int width, height;
  double largest_luminance, mean_luminance;  // of the finite pixels
  EnvmapAttribute envmap = EnvmapAttribute::none;
};

constexpr RealFile kRealFiles[] = {
    {"environments/latlong_hdr/vestibule_1k.hdr", 1024, 512, 195.2, 0.6961},
    {"environments/latlong_hdr/aerodynamics_workshop_1k.hdr", 1024, 512, 35.82, 0.3864},
    {"environments/latlong_hdr/kloppenheim_05_1k.hdr", 1024, 512, 7.894e4, 1.594},
    {"environments/latlong_hdr/st_peters_square_night_1k.hdr", 1024, 512, 9134, 0.7176},
    {"environments/latlong_hdr/studio_small_05_1k.hdr", 1024, 512, 86.5, 0.4179},
    {"environments/latlong_hdr/spiaggia_di_mondello_1k.hdr", 1024, 512, 7.095e4, 0.678},
    // Its primaries are Rec. 709 adapted to D50, so that the conversion changes next to nothing.
    {"environments/latlong_exr/blender_city.exr", 1024, 512, 3.175e4, 1.055},
    {"environments/latlong_exr/blender_interior.exr", 1024, 512, 3.222e4, 0.9725},
    {"environments/latlong_exr/blender_night.exr", 1024, 512, 4220, 0.1407},
    {"environments/latlong_exr/blender_studio.exr", 1024, 512, 110.9, 0.2549},
    {"environments/latlong_exr/pmndrs_apartment.exr", 512, 256, 14.05, 0.6461},
    {"environments/latlong_exr/pmndrs_sky.exr", 512, 256, 2.25e4, 0.6736},
    {"environments/furnace/white_furnace.exr", 2048, 1024, 1, 1},
    {"environments/envmap_attribute/OrientationLatLong.exr", 1024, 512, 0.9907, 0.9098,
     EnvmapAttribute::latlong},
    {"environments/envmap_attribute/OrientationCube.exr", 512, 3072, 0.9907, 0.94,
     EnvmapAttribute::cube},
    {"environments/envmap_attribute/StageEnvLatLong.exr", 1000, 500, 4096, 2.712,
     EnvmapAttribute::latlong},
    {"environments/envmap_attribute/StageEnvCube.exr", 256, 1536, 4096, 3.091,
     EnvmapAttribute::cube},
    {"environments/light_probe/vestibule_angular_512.hdr", 512, 512, 153.1, 0.9208},
    {"environments/light_probe/kloppenheim_05_angular_512.hdr", 512, 512, 2.658e4, 0.4348},
    {"environments/light_probe/st_peters_square_night_mirrorball_512.hdr", 512, 512, 4008, 0.7469},
    {"environments/light_probe/orientation_angular_512.hdr", 512, 512, 0.9883, 0.7125},
    {"environments/light_probe/orientation_mirrorball_512.hdr", 512, 512, 0.9883, 0.7264},
    {"exposures/parliament/gegl_exp_combine_reference.hdr", 144, 220, 0.1792, 0.002854},
    {"exposures/parliament/parliament.hdr", 144, 220, 21.18, 0.1101},
    {"exr_decoding/BrightRings.exr", 800, 800, 1025, 27.59},
    {"exr_decoding/BrightRingsNanInf.exr", 800, 800, 1025, 27.59},
    {"exr_decoding/WideColorGamut.exr", 800, 800, 1.001, 1},
    {"exr_decoding/t01.exr", 400, 300, 2, 0.06159},
    {"exr_decoding/t03.exr", 400, 300, 2, 0.06159},
    {"exr_decoding/t09.exr", 400, 300, 2, 0.06159},
    {"exr_decoding/comp_piz.exr", 587, 675, 406.5, 7.509},
    {"exr_decoding/comp_dwaa_v2.exr", 587, 675, 410.6, 7.508},
    {"exr_decoding/lineOrder_decreasing.exr", 237, 119, 2127, 924.7},
    {"hdr_decoding/car-stack-eighth.hdr", 129, 97, 1, 0.2642},
};

class RealImage : public testing::TestWithParam<RealFile> {};
INSTANTIATE_TEST_SUITE_P(Every, RealImage, testing::ValuesIn(kRealFiles), [](const auto& param) {
  std::string name = fs::path(param.param.path).filename().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
});

TEST_P(RealImage, HasTheSizeAndLuminanceThatOthersMeasured) {
  LIGHTKILN_NEEDS_DATA(data);
  const RealFile& file = GetParam();
  const DecodedImage decoded = decode_hdr_image(test::read_file(data / file.path));
  EXPECT_EQ(decoded.image.width, file.width);
  EXPECT_EQ(decoded.image.height, file.height);
  EXPECT_EQ(decoded.image.channels, 3);
  EXPECT_EQ(decoded.envmap, file.envmap);
  double largest = 0, sum = 0;
  uint64_t finite = 0;
  for (int y = 0; y < decoded.image.height; ++y) {
    for (int x = 0; x < decoded.image.width; ++x) {
      const Vec3 rgb = decoded.image.rgb(x, y);
      if (!is_finite(rgb)) continue;
      largest = std::max(largest, luminance(to_double(rgb)));
      sum += luminance(to_double(rgb));
      ++finite;
    }
  }
  // The figures are stated in four digits, and three where the last is a zero.
  EXPECT_NEAR(largest / file.largest_luminance, 1, 6e-4);
  EXPECT_NEAR(sum / static_cast<double>(finite) / file.mean_luminance, 1, 6e-4);
}

TEST(RealFiles, CountsWhatThePublishedImageSpoils) {
  LIGHTKILN_NEEDS_DATA(data);
  Image clean = decode_hdr_image(test::read_file(data / "exr_decoding/BrightRings.exr")).image;
  Image spoilt =
      decode_hdr_image(test::read_file(data / "exr_decoding/BrightRingsNanInf.exr")).image;
  uint64_t nan = 0, infinite = 0, pixels = 0;
  for (int y = 0; y < spoilt.height; ++y)
    for (int x = 0; x < spoilt.width; ++x) pixels += !is_finite(spoilt.rgb(x, y));
  for (size_t i = 0; i < spoilt.pixels.size(); ++i) {
    nan += std::isnan(spoilt.pixels[i]);
    infinite += std::isinf(spoilt.pixels[i]);
    if (!std::isfinite(spoilt.pixels[i])) clean.pixels[i] = 0;
  }
  EXPECT_EQ(pixels, 12u);
  const PixelRepairs repairs = sanitise(spoilt);
  EXPECT_EQ(repairs.nan, nan);
  EXPECT_EQ(repairs.infinite, infinite);
  EXPECT_GT(repairs.nan, 0u);
  EXPECT_EQ(spoilt.pixels, clean.pixels);
}

// The mean difference per channel, relative to the mean, of `a` against `b` moved right by `shift`.
std::array<double, 3> mean_difference(const Image& a, const Image& b, int shift) {
  std::array<double, 3> difference{}, sum{};
  for (int y = 0; y < std::min(a.height, b.height); ++y) {
    for (int x = shift; x < std::min(a.width, b.width); ++x) {
      for (int c = 0; c < 3; ++c) {
        const double expected = b.rgb(x - shift, y)[c];
        difference[static_cast<size_t>(c)] += std::abs(double{a.rgb(x, y)[c]} - expected);
        sum[static_cast<size_t>(c)] += expected;
      }
    }
  }
  for (size_t c = 0; c < 3; ++c) difference[c] /= sum[c];
  return difference;
}

// One photograph with full colour and with halved chroma in lossy blocks: they differ where colour
// changes from pixel to pixel, by less than half of what a misplacement by one pixel does.
TEST(RealFiles, ReadsLuminanceChroma) {
  LIGHTKILN_NEEDS_DATA(data);
  const Image image = decode_hdr_image(test::read_file(data / "exr_decoding/Rec709_YC.exr")).image;
  EXPECT_EQ(image.width, 610);
  EXPECT_EQ(image.height, 406);
  EXPECT_EQ(image.channels, 3);
  const Image chroma = decode_hdr_image(test::read_file(data / "exr_decoding/comp_b44.exr")).image;
  const Image plain = decode_hdr_image(test::read_file(data / "exr_decoding/comp_piz.exr")).image;
  ASSERT_EQ(chroma.width, 586);
  ASSERT_EQ(chroma.height, 674);
  const auto in_place = mean_difference(chroma, plain, 0);
  const auto moved = mean_difference(chroma, plain, 1);
  for (size_t c = 0; c < 3; ++c) EXPECT_LT(in_place[c], moved[c] / 2) << "channel " << c;
}

TEST(RealFiles, ReadsPhotographs) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* name : {"parliament_0.png", "parliament_1.png", "parliament_2.png"}) {
    const Image8 image = read_ldr(test::read_file(data / "exposures/parliament" / name));
    EXPECT_EQ(image.width, 144);
    EXPECT_EQ(image.height, 220);
  }
  const Image8 cyan =
      read_ldr(test::read_file(data / "invalid/gltf_validator/clean/image/cyan.jpg"));
  EXPECT_NEAR(cyan.pixels[0], 0, 3);
  EXPECT_NEAR(cyan.pixels[1], 255, 3);
  EXPECT_NEAR(cyan.pixels[2], 255, 3);
  const Image8 magenta =
      read_ldr(test::read_file(data / "invalid/gltf_validator/clean/image/magenta.png"));
  EXPECT_EQ((std::array{magenta.pixels[0], magenta.pixels[1], magenta.pixels[2]}),
            (std::array<uint8_t, 3>{255, 0, 255}));
  EXPECT_REFUSED(read_ldr(test::read_file(
                     data / "invalid/gltf_validator/clean/image/unrecognized_format.png")),
                 invalid_input, "");
}

// Every damaged file is refused or read, whole, in bounded memory.
TEST(RealFiles, SurvivesEveryDamagedOpenExr) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto peak = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
  };
  const long before = peak();
  int files = 0;
  std::vector<std::string> read;
  for (const char* folder : {"exr_damaged", "exr_openexr_tests"}) {
    for (const auto& entry : fs::directory_iterator(data / "invalid" / folder)) {
      ++files;
      try {
        const Image image = read_exr(test::read_file(entry.path())).image;
        EXPECT_EQ(image.pixels.size(), size_t{3} * 40 * 40);
        read.push_back(entry.path().filename().string());
      } catch (const Error& refusal) {
        EXPECT_TRUE(refusal.code() == ErrorCode::invalid_input ||
                    refusal.code() == ErrorCode::unsupported ||
                    refusal.code() == ErrorCode::too_large)
            << entry.path() << ": " << refusal.what();
      }
    }
  }
  EXPECT_EQ(files, 86);
  // These three are sound but for the name of their storage, which the version word contradicts.
  std::sort(read.begin(), read.end());
  EXPECT_EQ(read, (std::vector<std::string>{"scanline_with_deepscanline_type.exr",
                                            "scanline_with_tiledimage_type.exr",
                                            "tiled_with_deeptile_type.exr"}));
  EXPECT_LT(peak() - before, 200 * 1024) << "KiB";
}

// An independent reader, where one is installed: every sample of the picture as text.
TEST(RealFiles, AgreesWithAnIndependentReader) {
  LIGHTKILN_NEEDS_DATA(data);
  if (std::system("command -v oiiotool >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "no oiiotool to compare with";
  for (const char* name : {"exr_decoding/t03.exr", "exr_decoding/lineOrder_decreasing.exr",
                           "hdr_decoding/car-stack-eighth.hdr"}) {
    const Image image = decode_hdr_image(test::read_file(data / name)).image;
    const std::string command =
        "oiiotool --dumpdata '" + (data / name).string() + "' --ch R,G,B 2>/dev/null";
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    ASSERT_TRUE(pipe);
    std::array<char, 1024> line{};
    size_t compared = 0;
    while (fgets(line.data(), line.size(), pipe.get())) {
      int x = 0, y = 0;
      float rgb[3] = {};
      if (std::sscanf(line.data(), " Pixel (%d, %d): %f %f %f", &x, &y, rgb, rgb + 1, rgb + 2) != 5)
        continue;
      ASSERT_LT(x, image.width);
      ASSERT_LT(y, image.height);
      for (int c = 0; c < 3; ++c) {
        const float ours = image.at(x, y)[c];
        if (std::isfinite(ours)) {
          ASSERT_NEAR(ours, rgb[c], 1e-6 * std::abs(rgb[c]) + 1e-9) << name << ' ' << x << ' ' << y;
        } else {
          ASSERT_EQ(std::isnan(ours), std::isnan(rgb[c])) << name << ' ' << x << ' ' << y;
        }
      }
      ++compared;
    }
    EXPECT_EQ(compared, static_cast<size_t>(image.width) * static_cast<size_t>(image.height))
        << name;
  }
}

}  // namespace
}  // namespace lightkiln
