#include "core/sphere/harmonic_window.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/base/random.h"
#include "core/sphere/harmonic_minimum.h"
#include "core/sphere/harmonic_transform.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

Vec3d random_direction(uint64_t key, uint32_t index) {
  const Point2 p = sobol2(key, index);
  const double z = 1 - 2.0 * p.x, r = std::sqrt(1 - z * z), phi = 2 * kPi * p.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

ShRgb delta(const Vec3d& direction, int bands, const Vec3d& colour = {1, 1, 1}) {
  std::vector<double> basis(sh_coefficient_count(bands));
  sh_evaluate_basis(direction, bands, basis);
  ShRgb sh(bands);
  for (size_t i = 0; i < basis.size(); ++i) sh.coefficients[i] = colour * basis[i];
  return sh;
}

ShRgb add(ShRgb a, const ShRgb& b) {
  for (size_t i = 0; i < a.coefficients.size(); ++i) a.coefficients[i] += b.coefficients[i];
  return a;
}

WindowedSh window(const ShRgb& sh, ShWindow kind, ShQuantity quantity = ShQuantity::irradiance) {
  Progress progress;
  return window_sh(sh, kind, quantity, 1, progress);
}

// H3: The unit delta's irradiance of three bands spans [-19/480, 17/16]; its mean is 1/4.
TEST(HarmonicWindow, KnowsHowADeltaRings) {
  const WindowedSh hann = window(delta(normalize(Vec3d{0.3, -0.5, 0.7}), 3), ShWindow::hann);
  EXPECT_NEAR(hann.report.before.luminance_min / 4, -19.0 / 480, 1e-9);
  EXPECT_NEAR(hann.report.before.luminance_max / 4, 17.0 / 16, 1e-9);
  EXPECT_NEAR(hann.report.after.luminance_min / 4, -0.0469, 5e-5);
  const WindowedSh lanczos = window(delta({0, 1, 0}, 3), ShWindow::lanczos);
  EXPECT_NEAR(lanczos.report.after.luminance_min / 4, -0.0343, 5e-5);
}

TEST(HarmonicWindow, FindsTheSmallestFilterOfADelta) {
  for (uint32_t i = 0; i < 6; ++i) {
    const WindowedSh result =
        window(delta(random_direction(1, i), 3, {1, 5, 0.1}), ShWindow::minimal);
    EXPECT_NEAR(result.report.lambda, 0.17773, 5e-6);
    EXPECT_GE(result.report.after.lowest, -1e-6);
    EXPECT_GE(result.report.proven_lowest, -3e-6);
  }
}

// One delta's filtered sum is zonal, lowest at a root of a Legendre series: found here by brute
// force over the angle, at any number of bands and for either quantity.
double brute_lowest(int bands, double lambda, ShQuantity quantity) {
  double lowest = 1e300;
  for (int i = 0; i <= 20000; ++i) {
    const double c = std::cos(kPi * i / 20000);
    double before = 1, value = c, sum = 1;
    for (int l = 1; l < bands; ++l) {
      const double w = 1 / (1 + lambda * l * l * (l + 1.0) * (l + 1.0));
      const double a = quantity == ShQuantity::radiance ? 1.0 : clamped_cosine_band(l) / kPi;
      sum += (2 * l + 1) * w * a * value;
      const double next = ((2 * l + 1) * c * value - l * before) / (l + 1);
      before = value;
      value = next;
    }
    lowest = std::min(lowest, sum);
  }
  return lowest;
}

TEST(HarmonicWindow, IsMinimalAtAnyNumberOfBands) {
  for (const int bands : {2, 3, 4, 6, 9, 17, 33}) {
    for (const ShQuantity quantity : {ShQuantity::radiance, ShQuantity::irradiance}) {
      const WindowedSh result = window(delta({0.6, 0, 0.8}, bands), ShWindow::minimal, quantity);
      EXPECT_GE(brute_lowest(bands, result.report.lambda, quantity), -2e-6) << bands;
      EXPECT_GE(result.report.proven_lowest, -3e-6) << bands;
      if (result.report.lambda > 0) {
        EXPECT_LT(brute_lowest(bands, 0.999 * result.report.lambda, quantity), -1e-6) << bands;
      }
    }
  }
}

TEST(HarmonicWindow, KeepsTheMeanToTheBitAndLeavesPositiveLightAlone) {
  ShRgb sky = delta({0, 1, 0}, 5, {0.01, 0.01, 0.01});
  sky.coefficients[0] += Vec3d{3.1, 2.7, 1.9};
  for (const ShQuantity quantity : {ShQuantity::radiance, ShQuantity::irradiance}) {
    const WindowedSh result = window(sky, ShWindow::minimal, quantity);
    EXPECT_EQ(result.report.lambda, 0);
    EXPECT_EQ(result.sh.coefficients, sky.coefficients);
    EXPECT_EQ(result.report.energy_removed, 0);
    EXPECT_EQ(result.report.contrast_removed, 0);
  }
  const ShRgb sun = delta({0, 1, 0}, 5, {0.7, 1.3, 2.9});
  for (const ShWindow kind : {ShWindow::hann, ShWindow::lanczos, ShWindow::minimal}) {
    EXPECT_EQ(window(sun, kind).sh.coefficients[0], sun.coefficients[0]);
  }
  EXPECT_EQ(window(sun, ShWindow::none).sh.coefficients, sun.coefficients);
}

// A coloured pair of suns over a sky: the blue channel alone goes negative. Positive control:
// without the treatment it does.
TEST(HarmonicWindow, ServesEveryChannelAndEveryDirection) {
  ShRgb sky = add(delta(normalize(Vec3d{1, 2, 3}), 9, {0.2, 0.2, 3}),
                  delta(normalize(Vec3d{-3, 0.5, 1}), 9, {1, 0, 0}));
  sky.coefficients[0] += Vec3d{3, 3, 0};
  const WindowedSh result = window(sky, ShWindow::minimal, ShQuantity::radiance);
  double before = 1e300, after = 1e300;
  for (uint32_t i = 0; i < 4096; ++i) {
    const Vec3d d = random_direction(2, i);
    const Vec3d raw = sh_evaluate(sky, d), treated = sh_evaluate(result.sh, d);
    for (int c = 0; c < 3; ++c) {
      before = std::min(before, raw[c]);
      after = std::min(after, treated[c]);
    }
  }
  EXPECT_LT(before, -0.5);
  EXPECT_GE(after, -1e-5);
  EXPECT_GT(result.report.energy_removed, 0.1);
  EXPECT_GT(result.report.contrast_removed, 0.1);
  EXPECT_LT(result.report.contrast_removed, 1);
}

TEST(HarmonicWindow, ServesAWholeMapWithASun) {
  Progress progress;
  const Image sky = reference::test_sky(64, 2e4);
  for (const int bands : {3, 9, 33}) {
    const ShRgb sh = world_harmonics(project_latlong(sky, bands, 3, 1, progress), bands);
    const WindowedSh result = window(sh, ShWindow::minimal, ShQuantity::radiance);
    EXPECT_LT(result.report.before.lowest, -0.1);
    EXPECT_GE(result.report.after.lowest, -2e-6);
    EXPECT_GT(result.report.lambda, 0);
  }
}

TEST(HarmonicWindow, ReturnsBlackAsItIsAndRefusesDarknessWithLight) {
  EXPECT_EQ(window(ShRgb(4), ShWindow::minimal).sh.coefficients, ShRgb(4).coefficients);
  ShRgb odd(3);
  odd.coefficients[2] = {1, 1, 1};
  EXPECT_THROW(window(odd, ShWindow::minimal), Error);
}

TEST(HarmonicMinimum, IsAtMostTheTruthAndNear) {
  ShRgb sky = add(delta(normalize(Vec3d{1, 2, 3}), 12), delta(normalize(Vec3d{-1, 0.2, 1}), 12));
  sky.coefficients[0] *= 3;
  const RelativeField field(sky);
  const std::vector<double> factors(12, 1.0);
  Progress progress;
  const double found = lowest_points(field, factors, 4, 1, progress).front().value;
  double sampled = 1e300;
  for (uint32_t i = 0; i < 20000; ++i) {
    sampled = std::min(sampled, sh_evaluate(sky, random_direction(5, i)).x);
  }
  const double mean = sky.coefficients[0].x / (2 * std::sqrt(kPi));
  EXPECT_LE(found, sampled / mean);
  EXPECT_GE(found, sampled / mean - 0.05);
  const MinimumBound bound = bound_minimum(field, factors, found, 1e-4, 1, progress);
  EXPECT_FALSE(bound.refuted);
  EXPECT_LE(bound.bound, found);
  EXPECT_GE(bound.bound, found - 1.01e-4);
  // A value above the minimum is refuted.
  EXPECT_TRUE(bound_minimum(field, factors, found + 0.01, 1e-4, 1, progress).refuted);
}

TEST(HarmonicMinimum, EvaluatesBandsApart) {
  const ShRgb sh = delta(normalize(Vec3d{1, -2, 0.3}), 40, {1, 2, 3});
  const ShBandParts parts(sh);
  std::vector<Vec3d> bands(40);
  for (uint32_t i = 0; i < 20; ++i) {
    const Vec3d d = i < 2 ? Vec3d{0, 0, i == 0 ? 1.0 : -1.0} : random_direction(6, i);
    parts.evaluate(d, bands);
    Vec3d sum;
    for (const Vec3d& band : bands) sum += band;
    EXPECT_LT(length(sum - sh_evaluate(sh, d)), 1e-11);
  }
}

}  // namespace
}  // namespace lightkiln
