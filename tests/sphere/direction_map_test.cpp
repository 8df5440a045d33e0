#include "core/sphere/direction_map.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "core/sphere/solid_angle.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

TEST(DirectionMap, PutsTheAxesWhereTheStandardSays) {
  double u = 0, v = 0;
  latlong_coordinates({0, 0, 1}, &u, &v);
  EXPECT_NEAR(u, 0.5, 1e-15);
  EXPECT_NEAR(v, 0.5, 1e-15);
  latlong_coordinates({1, 0, 0}, &u, &v);
  EXPECT_NEAR(u, 0.25, 1e-15);  // left of the centre
  latlong_coordinates({0, 1, 0}, &u, &v);
  EXPECT_NEAR(v, 0, 1e-15);
  latlong_coordinates({0, 0, -1}, &u, &v);
  EXPECT_NEAR(u, 0, 1e-15);
  latlong_coordinates({-0.0, 0, -1}, &u, &v);
  EXPECT_LT(u, 1);
}

TEST(DirectionMap, InvertsItself) {
  for (int i = 0; i < 40; ++i) {
    for (int j = 0; j < 40; ++j) {
      const double a = (i + 0.37) / 40, b = (j + 0.61) / 40;
      double u = 0, v = 0;
      latlong_coordinates(latlong_direction(a, b), &u, &v);
      EXPECT_NEAR(u, a, 1e-14);
      EXPECT_NEAR(v, b, 1e-14);
      for (int face = 0; face < 6; ++face) {
        int found = -1;
        double s = 0, t = 0;
        cube_coordinates(cube_direction(face, a, b), &found, &s, &t);
        EXPECT_EQ(found, face);
        EXPECT_NEAR(s, a, 1e-14);
        EXPECT_NEAR(t, b, 1e-14);
      }
    }
  }
}

// The text-bearing pair of images: sampling the lat-long one along the cube mapping must give the
// cube. Both carry OpenEXR's convention of pixel centres on the borders.
double orientation_error(const Image& latlong, const Image& cube, bool mirror) {
  const int size = cube.width;
  double sum = 0;
  int count = 0;
  for (int face = 0; face < 6; ++face) {
    for (int y = 0; y < size; y += 3) {
      for (int x = 0; x < size; x += 3) {
        double u = 0, v = 0;
        const double s = double(x) / (size - 1), t = double(y) / (size - 1);
        latlong_coordinates(cube_direction(face, mirror ? 1 - s : s, t), &u, &v);
        const int i = static_cast<int>(std::lround(u * (latlong.width - 1)));
        const int j = static_cast<int>(std::lround(v * (latlong.height - 1)));
        const Vec3 a = latlong.rgb(i, j), b = cube.rgb(x, face * size + y);
        const Vec3 d = a - b;
        sum += std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
        count += 3;
      }
    }
  }
  return sum / count;
}

TEST(DirectionMap, TurnsTheOrientationLatLongIntoTheOrientationCube) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto folder = data / "environments" / "envmap_attribute";
  const DecodedImage latlong = read_exr(test::read_file(folder / "OrientationLatLong.exr"));
  const DecodedImage cube = read_exr(test::read_file(folder / "OrientationCube.exr"));
  ASSERT_EQ(latlong.envmap, EnvmapAttribute::latlong);
  ASSERT_EQ(cube.envmap, EnvmapAttribute::cube);
  EXPECT_LT(orientation_error(latlong.image, cube.image, false), 0.02);
  EXPECT_GT(orientation_error(latlong.image, cube.image, true), 0.04);
}

// M1
TEST(SolidAngle, CubeFaceSumsToASixthOfTheSphere) {
  for (const int size : {1, 2, 64, 1024}) {
    double sum = 0;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) sum += cube_texel_solid_angle(x, y, size);
    }
    EXPECT_NEAR(sum, 4 * kPi / 6, 1e-12) << size;
  }
  const double ratio =
      cube_texel_solid_angle(0, 0, 4096) / cube_texel_solid_angle(2048, 2048, 4096);
  EXPECT_NEAR(ratio, std::pow(3.0, -1.5), 1e-3);
}

// The positive control: the same four terms in float are off by a quarter of a texel at 1024.
TEST(SolidAngle, OfAWholeFaceIsThatOfEachTexel) {
  for (const int size : {1, 2, 3, 8, 37, 256}) {
    const CubeSolidAngles face(size);
    double sum = 0;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        EXPECT_NEAR(face.at(x, y) / cube_texel_solid_angle(x, y, size), 1, 1e-10)
            << x << " " << y << " of " << size;
        sum += face.at(x, y);
      }
    }
    EXPECT_NEAR(sum, 4 * kPi / 6, 1e-12) << size;
  }
}

TEST(SolidAngle, WouldCancelInFloat) {
  const auto corner = [](float x, float y) {
    return std::atan2(x * y, std::sqrt(x * x + y * y + 1));
  };
  double worst = 0;
  for (int y = 0; y < 1024; y += 7) {
    for (int x = 0; x < 1024; x += 7) {
      const float x0 = 2.f * float(x) / 1024 - 1, x1 = 2.f * float(x + 1) / 1024 - 1;
      const float y0 = 2.f * float(y) / 1024 - 1, y1 = 2.f * float(y + 1) / 1024 - 1;
      const double omega =
          double(corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0));
      worst = std::max(worst, std::abs(omega / cube_texel_solid_angle(x, y, 1024) - 1));
    }
  }
  EXPECT_GT(worst, 0.05);
}

// M2
TEST(SolidAngle, LatLongRowsSumToTheSphere) {
  for (const int height : {1, 16, 512, 4096}) {
    double sum = 0, midpoint = 0;
    for (int y = 0; y < height; ++y) {
      sum += 2 * height * latlong_texel_solid_angle(y, 2 * height, height);
      midpoint += 2 * kPi * kPi / height * std::sin(kPi * (y + 0.5) / height);
    }
    EXPECT_NEAR(sum, 4 * kPi, 1e-12) << height;
    if (height == 16) {
      EXPECT_GT(midpoint / (4 * kPi) - 1, 1e-3);  // without the exact weights
    }
  }
}

// M3
TEST(SolidAngle, SmallSunDoesNotCancel) {
  const double sun = 0.2666 * kPi / 180;
  const double series = kPi * sun * sun * (1 - sun * sun / 12);  // the next term is 1e-12
  EXPECT_NEAR(cap_solid_angle(sun) / series, 1, 1e-6);
  const float in_float = 2 * float(kPi) * (1 - std::cos(float(sun)));
  EXPECT_GT(std::abs(in_float / series - 1), 1e-4);  // the usual formula, in float
  EXPECT_NEAR(cap_solid_angle(kPi), 4 * kPi, 1e-12);
  EXPECT_NEAR(cap_solid_angle(1e-6) / (kPi * 1e-12), 1, 1e-9);
}

}  // namespace
}  // namespace lightkiln
