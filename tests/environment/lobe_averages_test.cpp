#include "core/environment/lobe_averages.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/environment/ggx_lobe.h"
#include "core/environment/patch_integral.h"
#include "core/environment/vector_math.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/environment/convolved.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

using test::enlarged;
using test::environment_of;

const std::vector<Vec3d> kAxes = {
    {0.48, 0.6, 0.64}, {0, 1, 0},  {0, -1, 0}, normalize(Vec3d{1e-3, -1, 2e-3}),
    {-0.6, -0.8, 0},   {0, 0, 1},  {1, 0, 0},  normalize(Vec3d{0.3, 1e-9, -1}),
    {0, 0.6, -0.8},    {0, 0, -1}, {-1, 0, 0}, normalize(Vec3d{-0.7, 0.02, 0.4})};

LobeAverages averages(const Environment& sky, const Lobe& lobe, std::span<const Vec3d> axes = kAxes,
                      int threads = 1) {
  Progress progress;
  return lobe_averages(sky, *make_twin_lobe(lobe), axes, threads, progress);
}

// Green, each texel by its middle.
double by_midpoints(const Image& map, double alpha, const Vec3d& axis) {
  const GgxLobe lobe(alpha);
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    for (int x = 0; x < map.width; ++x) {
      const Vec3d middle = latlong_direction((x + 0.5) / map.width, (y + 0.5) / map.height);
      sum += double(map.rgb(x, y).y) * omega * lobe(dot(middle, axis));
    }
  }
  return sum;
}

// A lobe's average of a constant is that constant: its weights sum to 1 whatever share of a texel
// it is wide, over poles, across the seam and down to the horizon.
TEST(LobeAverages, KeepAConstant) {
  for (const int height : {1, 2, 16, 64, 300}) {
    Image grey(2 * height, height, 3);
    for (float& v : grey.pixels) v = 0.5f;
    const Environment sky = environment_of(grey);
    for (const Lobe& lobe : {Lobe{LobeKind::ggx, 1e-8},
                             {LobeKind::ggx, 1e-3},
                             {LobeKind::ggx, 0.06},
                             {LobeKind::ggx, 0.3},
                             {LobeKind::ggx, 1},
                             {LobeKind::charlie, 0.01},
                             {LobeKind::charlie, 0.06},
                             {LobeKind::charlie, 0.4},
                             {LobeKind::charlie, 1}}) {
      const LobeAverages seen = averages(sky, lobe);
      EXPECT_LE(seen.error, 1.01e-7 * 0.5 + 1e-9);
      for (size_t i = 0; i < seen.means.size(); ++i) {
        EXPECT_NEAR(seen.means[i].y, 0.5, seen.error)
            << height << " " << lobe.alpha << " " << i << " " << (lobe.kind == LobeKind::charlie);
      }
    }
  }
}

// Texels cut into equal ones are the same map to a lobe, but other patches to the twin, by other
// rules: both answers lie within what they say of themselves, under a sun as well. It cannot hide
// that a constant hides.
TEST(LobeAverages, StayWithinTheirOwnErrorWhenTexelsAreCut) {
  for (const auto& [height, factor] : {std::pair{8, 3}, {40, 4}, {150, 2}}) {
    Image map = reference::test_sky(height, 1e5);
    const Environment coarse = environment_of(map), fine = environment_of(enlarged(map, factor));
    for (const Lobe& lobe : {Lobe{LobeKind::ggx, 1e-3},
                             {LobeKind::ggx, 0.0123},
                             {LobeKind::ggx, 0.0625},
                             {LobeKind::ggx, 0.25},
                             {LobeKind::ggx, 1},
                             {LobeKind::charlie, 0.01},
                             {LobeKind::charlie, 0.0625},
                             {LobeKind::charlie, 0.5},
                             {LobeKind::charlie, 1}}) {
      const LobeAverages a = averages(coarse, lobe), b = averages(fine, lobe);
      for (size_t i = 0; i < a.means.size(); ++i) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_LE(std::abs(a.means[i][c] - b.means[i][c]),
                    2.2 * kTwinError * a.means[i][c] + 2 * kTwinEmpty * coarse.mean[c])
              << height << " " << lobe.alpha << " " << i << " " << (lobe.kind == LobeKind::charlie);
        }
      }
    }
    // Positive control: a point a texel is not enough.
    double worst = 0;
    const LobeAverages exact = averages(coarse, {LobeKind::ggx, 0.25});
    for (size_t i = 0; i < kAxes.size(); ++i) {
      worst = std::max(worst, std::abs(by_midpoints(map, 0.25, kAxes[i]) / exact.means[i].y - 1));
    }
    EXPECT_GT(worst, 1e-5) << height;
  }
}

TEST(LobeAverages, AgreeWithAnIndependentSumForEveryWidthOfLobe) {
  const Environment sky = environment_of(reference::test_sky(48, 1e3));
  for (const double alpha : {0.05, 0.25, 1.0}) {
    const LobeAverages ours = averages(sky, {LobeKind::ggx, alpha});
    for (size_t i = 0; i < kAxes.size(); ++i) {
      const Vec3d theirs = reference::prefilter(sky.radiance, alpha, kAxes[i]);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(ours.means[i][c] / theirs[c], 1, 2e-4) << alpha;
    }
  }
}

// Row by row and side by side, on any number of threads: nothing of it changes a bit.
TEST(LobeAverages, HaveTheSameBitsForAnyThreadsAndAxes) {
  const Environment sky = environment_of(reference::test_sky(140, 1e3));
  for (const Lobe& lobe : {Lobe{LobeKind::ggx, 0.09}, {LobeKind::charlie, 0.09}}) {
    const LobeAverages one = averages(sky, lobe);
    for (const int threads : {2, 8}) {
      EXPECT_EQ(averages(sky, lobe, kAxes, threads).means, one.means) << threads;
    }
    for (size_t i = 0; i < kAxes.size(); ++i) {
      EXPECT_EQ(averages(sky, lobe, {&kAxes[i], 1}).means[0], one.means[i]) << i;
    }
    EXPECT_TRUE(averages(sky, lobe, {}).means.empty());
  }
}

// At full roughness the lobe is max(c, 0) / pi. About an axis and about its opposite its integrals
// over a patch differ by that of c itself, the patch's moment, wherever the horizon cuts it.
TEST(PatchIntegral, CutsTheCosineExactlyAtItsHorizon) {
  const auto lobe = make_twin_lobe({LobeKind::ggx, 1});
  const int width = 24, height = 12;
  for (const Vec3d& axis : kAxes) {
    const double up = std::atan2(std::hypot(axis.x, axis.z), axis.y);
    const double phi = std::atan2(axis.x, axis.z);
    const double opposite = phi > 0 ? phi - kPi : phi + kPi;
    const PatchIntegral about(*lobe, up), against(*lobe, kPi - up);
    int cut = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto patch = [&](double longitude) {
          const double left = std::remainder(kPi - (x + 1) * 2 * kPi / width - longitude, 2 * kPi);
          return Patch{y * kPi / height, (y + 1) * kPi / height, left, left + 2 * kPi / width};
        };
        const double a = about(patch(phi)), b = against(patch(opposite));
        const double moment = dot(axis, latlong_texel_moment(x, y, width, height)) / kPi;
        EXPECT_NEAR(a - b, moment, 1e-8 * latlong_texel_solid_angle(y, width, height)) << x << y;
        cut += a > 1e-12 && b > 1e-12;
      }
    }
    if (std::abs(axis.x * axis.y * axis.z) > 0.01) {
      EXPECT_GT(cut, 20);
    }
  }
}

TEST(PositivePower, IsExactToThirteenDigits) {
  for (const double base : {1e-12, 1e-5, 0.03, 0.3, 0.6666, 0.66667, 0.99, 1.0, 1.3333, 1.9999}) {
    for (const double power : {0.5, 1.0, 2.5, 8.0, 50.0}) {
      const double truth = std::pow(base, power);
      const double digits = std::max(1.0, std::abs(power * std::log(base)));
      if (truth > 1e-290) {
        EXPECT_NEAR(positive_power(base, power) / truth, 1, 1e-13 * digits) << base << " " << power;
      }
    }
  }
  EXPECT_EQ(positive_power(0, 0.5), positive_power(1e-300, 0.5));
  EXPECT_EQ(positive_power(1e-12, 50), 0);
}

}  // namespace
}  // namespace lightkiln
