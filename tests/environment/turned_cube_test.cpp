#include "core/environment/turned_cube.h"

#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/environment/brute_force.h"
#include "core/environment/layout_convert.h"
#include "core/environment/layout_truth.h"

namespace lightkiln {
namespace {

constexpr int kSize = 8;

// White noise with a sun in two texels, its turn pending.
Environment sunny(const Rotation& turn) {
  DecodedImage decoded;
  decoded.image = Image(64, 32, 3);
  uint32_t state = 7;
  for (float& value : decoded.image.pixels) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) * 0x1p-23f;
  }
  for (const int x : {20, 21}) {
    for (int c = 0; c < 3; ++c) decoded.image.at(x, 9)[c] = 5e4f;
  }
  return make_pending_environment(std::move(decoded), {}, turn);
}

Rotation turn() {
  return quaternion_rotation(0.3, -0.5, 0.2, 0.7);
}

// Of every texel of the cube, line by line.
std::vector<Vec3d> slow_texels(const Environment& environment) {
  std::vector<Vec3d> truths;
  for (int line = 0; line < 6 * kSize; ++line) {
    for (int x = 0; x < kSize; ++x) {
      truths.push_back(texel_average(environment, line / kSize, x, line % kSize, kSize, 1 << 11));
    }
  }
  return truths;
}

// Over the sphere, relative to the mean.
double rms_error(const Environment& environment, const std::vector<Vec3d>& truths,
                 const Image& cube) {
  const MapLayout strip = make_layout(LayoutKind::cube_strip, kSize);
  double sum = 0;
  for (int line = 0; line < cube.height; ++line) {
    for (int x = 0; x < kSize; ++x) {
      const Vec3d error =
          to_double(cube.rgb(x, line)) - truths[static_cast<size_t>(line * kSize + x)];
      sum += texel_solid_angle(strip, x, line) * dot(error, error) / 3;
    }
  }
  return std::sqrt(sum / (4 * kPi)) / luminance(environment.mean);
}

TEST(TurnedCube, LeavesTheMapAsItIs) {
  const Environment environment = sunny(turn()), still = sunny(Rotation{});
  EXPECT_EQ(environment.radiance.pixels, still.radiance.pixels);
  EXPECT_TRUE(still.pending.is_identity());
  // Whole columns are moved, and nothing is left to do.
  const Environment moved = sunny(yaw_rotation(90));
  EXPECT_TRUE(moved.pending.is_identity());
  EXPECT_FALSE(moved.rotation.is_identity());
  EXPECT_EQ(moved.radiance.width, still.radiance.width);
}

TEST(TurnedCube, KeepsToItsBoundUnderASun) {
  const Environment environment = sunny(turn());
  const std::vector<Vec3d> truths = slow_texels(environment);
  Progress progress;
  for (const double order : {1e-2, 1e-3, 1e-4}) {
    const TurnedCubePlan plan = plan_turned_cube(environment, order);
    EXPECT_LE(plan.error_bound, order);
    const Image cube = turn_to_cube(environment, plan, kSize, 1, progress);
    EXPECT_LE(rms_error(environment, truths, cube), plan.error_bound) << order;
    EXPECT_EQ(turn_to_cube(environment, plan, kSize, 3, progress).pixels, cube.pixels);
    // Without the sum along meridians the sun's own texels are off by more.
    const Image converted =
        convert_layout(ConversionSource(make_layout(LayoutKind::latlong, 64), environment.radiance),
                       make_layout(LayoutKind::cube_strip, kSize), environment.pending,
                       MapFilter::area, plan.conversion_error, 1, progress);
    EXPECT_GT(rms_error(environment, truths, converted), 2 * rms_error(environment, truths, cube))
        << order;
  }
}

// The slow sum and the twin of conversions share no line, and the turn is the same in both.
TEST(TurnedCube, TurnsAsConversionsDo) {
  const Environment environment = sunny(turn());
  const MapLayout map = make_layout(LayoutKind::latlong, 64);
  const MapLayout strip = make_layout(LayoutKind::cube_strip, kSize);
  for (const auto& [x, line] : {std::pair{0, 0}, {3, 12}, {7, 23}, {4, 28}, {2, 35}, {5, 44}}) {
    const Vec3d slow = texel_average(environment, line / kSize, x, line % kSize, kSize, 512);
    const Vec3d twin = layout_truth(map, environment.radiance, strip, environment.pending,
                                    MapFilter::area, x, line, 256)
                           .radiance;
    EXPECT_LT(length(slow - twin), 1e-4 * length(twin)) << x << ' ' << line;
  }
}

}  // namespace
}  // namespace lightkiln
