#include "core/environment/brute_force.h"

#include <array>

#include <gtest/gtest.h>

#include "core/sphere/harmonic_transform.h"
#include "tests/environment/convolved.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

Environment sky_of(int height, double sun) {
  DecodedImage decoded;
  decoded.image = reference::test_sky(height, sun);
  return make_environment(decoded);
}

TEST(BruteForce, ProjectsOneCoefficientAtATime) {
  const Environment sky = sky_of(32, 100);
  Progress progress;
  const LatlongSpectrum spectrum = project_latlong(sky.radiance, 20, 8, 1, progress);
  for (const auto& [l, m] : {std::pair{0, 0}, {1, -1}, {1, 1}, {7, -4}, {19, 19}, {19, -1}}) {
    const double* at = &spectrum.coefficients[spectrum.offset(l, std::abs(m))] + (m < 0 ? 3 : 0);
    const Vec3d truth = projected_coefficient(sky, l, m);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(at[c], truth[c], 1e-9 * spectrum.coefficients[0]);
  }
}

// A row of a small map spans many radians of a high band.
TEST(BruteForce, ProjectsHighBandsOfSmallMaps) {
  const Environment sky = sky_of(4, 100);
  Progress progress;
  const LatlongSpectrum spectrum = project_latlong(sky.radiance, 129, 400, 1, progress);
  for (const auto& [l, m] : {std::pair{60, 3}, {128, 0}, {128, 64}, {100, 1}}) {
    const double* at = &spectrum.coefficients[spectrum.offset(l, m)];
    const Vec3d truth = projected_coefficient(sky, l, m);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(at[c], truth[c], 1e-9 * spectrum.coefficients[0]);
  }
}

TEST(BruteForce, AveragesATexelOfACube) {
  const Environment sky = sky_of(32, 10);
  // A side, a corner of the pole face, the pole inside a texel and on its corner.
  for (const auto& [face, x, y, size] :
       {std::array{0, 1, 3, 4}, {2, 0, 0, 4}, {2, 1, 1, 3}, {3, 1, 2, 4}, {5, 3, 1, 4}}) {
    const Vec3d ours = texel_average(sky, face, x, y, size);
    const Vec3d theirs = reference::cube_texel_mean(sky.radiance, face, x, y, size, 777);
    const Vec3d finer = texel_average(sky, face, x, y, size, 512);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(ours[c] / theirs[c], 1, 1e-3) << face;
      EXPECT_NEAR(ours[c] / finer[c], 1, 1e-5) << face;
    }
  }
}

}  // namespace
}  // namespace lightkiln
