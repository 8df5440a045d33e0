// OpenEXR's own exrenvmap as an independent reader of our orientation. Skips aloud where the tool
// is not installed.

#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "core/sphere/direction_map.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

// Smooth and alike under no mirror or turn.
Vec3d light(const Vec3d& d) {
  return {1 + 0.5 * d.x + 0.3 * d.y * d.z, 1 + 0.6 * d.y - 0.2 * d.x * d.z,
          1 + 0.4 * d.z + 0.4 * d.x * d.y};
}

TEST(IndependentReader, ExrenvmapTurnsOurLatLongIntoOurCube) {
  if (std::system("command -v exrenvmap >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "exrenvmap is not installed";
  }
  Image map(512, 256, 3);  // texel centres on the borders, as the attribute says
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 512; ++x) {
      const Vec3 value = to_float(light(latlong_direction(x / 511.0, y / 255.0)));
      std::copy_n(&value.x, 3, map.at(x, y));
    }
  }
  ExrWriteOptions options;
  options.envmap = EnvmapAttribute::latlong;
  const test::TemporaryFolder folder;
  const auto in = folder.path() / "latlong.exr", out = folder.path() / "cube.exr";
  test::write_file(in, write_exr(map, options));
  const std::string command = "exrenvmap -w 64 " + in.string() + " " + out.string();
  ASSERT_EQ(std::system(command.c_str()), 0);
  const DecodedImage cube = read_exr(test::read_file(out));
  ASSERT_EQ(cube.envmap, EnvmapAttribute::cube);
  ASSERT_EQ(cube.image.width, 64);
  ASSERT_EQ(cube.image.height, 384);
  double worst = 0, mirrored = 0;
  for (int y = 0; y < 384; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Vec3d value = to_double(cube.image.rgb(x, y));
      const double s = x / 63.0, t = (y % 64) / 63.0;
      worst = std::max(worst, length(value - light(cube_direction(y / 64, s, t))));
      mirrored = std::max(mirrored, length(value - light(cube_direction(y / 64, 1 - s, t))));
    }
  }
  EXPECT_LT(worst, 0.02);
  EXPECT_GT(mirrored, 0.5);
}

}  // namespace
}  // namespace lightkiln
