#include "core/environment/brute_force.h"

#include <array>

#include <gtest/gtest.h>

#include "core/environment/charlie_lobe.h"
#include "core/environment/ggx_lobe.h"
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

TEST(BruteForce, AgreesWithAnIndependentSumForEveryWidthOfLobe) {
  const Environment sky = sky_of(48, 1e3);
  for (const double alpha : {0.05, 0.25, 1.0}) {
    for (const Vec3d& axis : {Vec3d{0.48, 0.6, 0.64}, Vec3d{0, 1, 0}, Vec3d{-0.6, -0.8, 0}}) {
      const Vec3d ours = test::slow_average(sky, GgxLobe(alpha), {alpha}, axis);
      const Vec3d theirs = reference::prefilter(sky.radiance, alpha, axis);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(ours[c] / theirs[c], 1, 2e-4) << alpha << " " << c;
    }
  }
}

// A lobe's average of a constant is that constant: its weights sum to 1, also where a texel is
// wider than the lobe.
TEST(BruteForce, KeepsAConstant) {
  Environment grey = sky_of(64, 1);
  for (float& v : grey.radiance.pixels) v = 0.5f;
  for (const double alpha : {0.01, 0.1, 0.5, 1.0}) {
    const Vec3d average =
        test::slow_average(grey, GgxLobe(alpha), {alpha}, normalize(Vec3d{1, -2, 3}));
    EXPECT_NEAR(average.y, 0.5, 2e-5) << alpha;
  }
}

// Row by row and side by side, on any number of threads: nothing of it changes a bit.
TEST(BruteForce, GivesTheSameBitsForAnyThreadsAndAxes) {
  const Environment sky = sky_of(50, 1e3);  // rows that do not fill the last block
  const std::vector<Vec3d> axes = {{0.48, 0.6, 0.64}, {0, 1, 0}, {-0.6, -0.8, 0}};
  const GgxLobe lobe(0.3);
  Progress progress;
  const std::vector<Vec3d> one = lobe_averages(sky, lobe, {0.3}, axes, 1, progress);
  for (const int threads : {2, 8}) {
    EXPECT_EQ(lobe_averages(sky, lobe, {0.3}, axes, threads, progress), one) << threads;
  }
  for (size_t i = 0; i < axes.size(); ++i) {
    EXPECT_EQ(test::slow_average(sky, lobe, {0.3}, axes[i]), one[i]) << i;
  }
  EXPECT_TRUE(lobe_averages(sky, lobe, {0.3}, {}, 2, progress).empty());
}

TEST(BruteForce, FillsALobeWithTheBitsOfItsSingleValues) {
  std::vector<double> cosines = {-1, -1e-9, 0, 1e-12, 0.3, 0.999999, 1};
  for (int i = 0; i < 30; ++i) cosines.push_back(std::sin(3.7 * i));
  std::vector<double> ggx(cosines.size()), charlie(cosines.size());
  for (const double alpha : {1e-3, 0.25, 1.0}) {
    GgxLobe(alpha).fill(cosines, ggx);
    CharlieLobe(alpha).fill(cosines, charlie);
    for (size_t i = 0; i < cosines.size(); ++i) {
      EXPECT_EQ(ggx[i], GgxLobe(alpha)(cosines[i])) << cosines[i];
      EXPECT_EQ(charlie[i], CharlieLobe(alpha)(cosines[i])) << cosines[i];
    }
  }
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
