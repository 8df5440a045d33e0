// Programs and files of others as readers of our layouts: OpenEXR's exrenvmap, pfstools'
// pfspanoramic, and probes that pfspanoramic made. Skips aloud where they are missing.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/environment/layout_convert.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

bool has_program(const std::string& name) {
  return std::system(("command -v " + name + " >/dev/null 2>&1").c_str()) == 0;
}

// Smooth and alike under no mirror or turn; positive.
Vec3d light(const Vec3d& d) {
  return {2 + 0.5 * d.x + 0.3 * d.y * d.z, 2 + 0.6 * d.y - 0.2 * d.x * d.z,
          2 + 0.4 * d.z + 0.4 * d.x * d.y};
}

Image paint(const MapLayout& layout) {
  Image image(layout.width, layout.height, 3);
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      const auto d = layout_direction(layout, x + 0.5, y + 0.5);
      const Vec3 value = d ? to_float(light(*d)) : Vec3{};
      std::copy_n(&value.x, 3, image.at(x, y));
    }
  }
  return image;
}

// The largest difference from light() over directions that pass, and with left and right exchanged.
struct Difference {
  double worst = 0, mirrored = 0;
};
template <typename Filter>
Difference compare(const MapLayout& layout, const Image& image, Filter passes) {
  Difference difference;
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      const auto d = layout_direction(layout, x + 0.5, y + 0.5);
      if (!d || !passes(*d)) continue;
      const Vec3d value = to_double(image.rgb(x, y));
      difference.worst = std::max(difference.worst, length(value - light(*d)));
      difference.mirrored =
          std::max(difference.mirrored, length(value - light({-d->x, d->y, d->z})));
    }
  }
  return difference;
}

TEST(LayoutReaders, ExrenvmapTurnsOurCubeIntoALatLong) {
  if (!has_program("exrenvmap")) GTEST_SKIP() << "exrenvmap is not installed";
  MapLayout map = make_layout(LayoutKind::latlong, 256);
  MapLayout strip = make_layout(LayoutKind::cube_strip, 128);
  map.convention = strip.convention = TexelConvention::openexr;
  Progress progress;
  const Image cube = convert_layout(map, paint(map), strip, {}, MapFilter::adaptive, 1, progress);
  ExrWriteOptions options;
  options.envmap = EnvmapAttribute::cube;
  const test::TemporaryFolder folder;
  const auto in = folder.path() / "cube.exr", out = folder.path() / "latlong.exr";
  test::write_file(in, write_exr(cube, options));
  ASSERT_EQ(std::system(("exrenvmap -l -w 128 " + in.string() + " " + out.string()).c_str()), 0);
  const DecodedImage back = read_exr(test::read_file(out));
  ASSERT_EQ(back.envmap, EnvmapAttribute::latlong);
  MapLayout layout = make_layout(LayoutKind::latlong, back.image.width);
  layout.convention = TexelConvention::openexr;
  ASSERT_EQ(layout.height, back.image.height);
  const Difference difference = compare(layout, back.image, [](const Vec3d&) { return true; });
  EXPECT_LT(difference.worst, 0.03);
  EXPECT_GT(difference.mirrored, 0.5);
}

TEST(LayoutReaders, PfspanoramicAgreesOnAngularMapsAndCylinders) {
  if (!has_program("pfspanoramic")) GTEST_SKIP() << "pfspanoramic (pfstools) is not installed";
  const MapLayout map = make_layout(LayoutKind::latlong, 512);
  const test::TemporaryFolder folder;
  const auto in = folder.path() / "in.exr", out = folder.path() / "out.hdr";
  test::write_file(in, write_exr(paint(map), {}));
  const auto run = [&](const std::string& to, int width, int height) {
    const std::string command = "pfsin " + in.string() + " 2>/dev/null | pfspanoramic polar+" + to +
                                " -w " + std::to_string(width) + " -h " + std::to_string(height) +
                                " -o 3 | pfsout " + out.string() + " 2>/dev/null";
    return std::system(command.c_str()) == 0;
  };
  ASSERT_TRUE(run("angular", 128, 128));
  // Radiance's eight bits cost 1/128 of the largest channel; its whole texels 0.02.
  const MapLayout angular = make_layout(LayoutKind::angular, 128);
  Difference difference = compare(angular, decode_hdr_image(test::read_file(out)).image,
                                  [](const Vec3d& d) { return d.z > -0.98; });
  EXPECT_LT(difference.worst, 0.06);
  EXPECT_GT(difference.mirrored, 0.5);
  ASSERT_TRUE(run("cylindrical", 128, 64));
  const MapLayout cylinder = make_layout(LayoutKind::cylinder_equal_area, 128);
  difference = compare(cylinder, decode_hdr_image(test::read_file(out)).image,
                       [](const Vec3d& d) { return std::abs(d.y) < 0.95; });
  EXPECT_LT(difference.worst, 0.06);
  EXPECT_GT(difference.mirrored, 0.5);
}

// A map and a probe of it made by another program; also with left and right exchanged.
void expect_same_probe(const std::filesystem::path& map_file,
                       const std::filesystem::path& probe_file, LayoutKind kind, double within,
                       double mirrored_beyond) {
  DecodedImage map = decode_hdr_image(test::read_file(map_file));
  const Image probe = decode_hdr_image(test::read_file(probe_file)).image;
  MapLayout from = make_layout(LayoutKind::latlong, map.image.width);
  MapLayout to = make_layout(kind, probe.width);
  sanitise(map.image);
  Progress progress;
  for (const bool mirrored : {false, true}) {
    to.mirrored = mirrored;
    const Image ours = convert_layout(from, map.image, to, {}, MapFilter::adaptive, 2, progress);
    double sum = 0, all = 0;
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        // Off the rim, and a lamp's burnt-out texels capped: they differ by how points fall.
        const double right = 2 * (x + 0.5) / to.width - 1, down = 2 * (y + 0.5) / to.height - 1;
        if (std::hypot(right, down) > 0.95) continue;
        const double a = std::min(1.0, luminance(to_double(ours.rgb(x, y))));
        const double b = std::min(1.0, luminance(to_double(probe.rgb(x, y))));
        sum += std::abs(a - b);
        all += b;
      }
    }
    if (mirrored) {
      EXPECT_GT(sum / all, mirrored_beyond) << probe_file;
    } else {
      EXPECT_LT(sum / all, within) << probe_file;
    }
  }
}

TEST(LayoutReaders, TurnsRealMapsIntoTheProbesThatAnotherProgramMade) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto folder = data / "environments";
  const auto probes = folder / "light_probe";
  expect_same_probe(folder / "envmap_attribute/OrientationLatLong.exr",
                    probes / "orientation_angular_512.hdr", LayoutKind::angular, 0.03, 0.05);
  expect_same_probe(folder / "envmap_attribute/OrientationLatLong.exr",
                    probes / "orientation_mirrorball_512.hdr", LayoutKind::mirror_ball, 0.03, 0.05);
  expect_same_probe(folder / "latlong_hdr/vestibule_1k.hdr", probes / "vestibule_angular_512.hdr",
                    LayoutKind::angular, 0.08, 0.2);
  expect_same_probe(folder / "latlong_hdr/kloppenheim_05_1k.hdr",
                    probes / "kloppenheim_05_angular_512.hdr", LayoutKind::angular, 0.08, 0.15);
  expect_same_probe(folder / "latlong_hdr/st_peters_square_night_1k.hdr",
                    probes / "st_peters_square_night_mirrorball_512.hdr", LayoutKind::mirror_ball,
                    0.08, 0.2);
}

// OpenEXR's own pair of the text-bearing map: our conversion of the one is the other.
TEST(LayoutReaders, TurnsOpenExrsLatLongsIntoItsCubes) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto folder = data / "environments" / "envmap_attribute";
  const DecodedImage map = read_exr(test::read_file(folder / "OrientationLatLong.exr"));
  const DecodedImage cube = read_exr(test::read_file(folder / "OrientationCube.exr"));
  MapLayout from = make_layout(LayoutKind::latlong, map.image.width);
  MapLayout to = make_layout(LayoutKind::cube_strip, cube.image.width);
  from.convention = to.convention = TexelConvention::openexr;
  Progress progress;
  const auto difference = [&](const Image& ours, bool mirrored) {
    double sum = 0;
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        const Vec3d a = to_double(ours.rgb(mirrored ? to.width - 1 - x : x, y));
        sum += std::abs(luminance(a - to_double(cube.image.rgb(x, y))));
      }
    }
    return sum / to.width / to.height;
  };
  const Image ours = convert_layout(from, map.image, to, {}, MapFilter::adaptive, 2, progress);
  EXPECT_LT(difference(ours, false), 0.02);
  EXPECT_GT(difference(ours, true), 0.04);
}

}  // namespace
}  // namespace lightkiln
