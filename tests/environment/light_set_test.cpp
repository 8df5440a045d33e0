#include "core/environment/light_set.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/environment/made_maps.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::energy_of;
using test::environment_of;
using test::map_of;

constexpr LightSplit kSplits[] = {LightSplit::median_cut, LightSplit::variance_cut,
                                  LightSplit::clusters};

LightCells gather(const Environment& environment) {
  Progress progress;
  return gather_light(environment, 1, progress);
}

std::vector<DirectionalLight> split(const LightCells& light, int count, LightSplit how) {
  Progress progress;
  return split_lights(light, count, how, 1, progress);
}

Environment real_map(const std::filesystem::path& data, const std::string& name) {
  return make_environment(
      decode_hdr_image(test::read_file(data / "environments/latlong_hdr" / name)));
}

const char* const kMaps[] = {"kloppenheim_05_1k.hdr", "spiaggia_di_mondello_1k.hdr",
                             "st_peters_square_night_1k.hdr", "vestibule_1k.hdr",
                             "studio_small_05_1k.hdr"};

TEST(LightCells, KeepAllLightAndItsIrradiance) {
  for (const int height : {3, 40, 130, 300}) {  // 300: blocks of 3 x 3 texels, remainders
    const Environment environment = environment_of(reference::test_sky(height, 1e4));
    const LightCells light = gather(environment);
    const Vec3d whole = energy_of(environment.radiance);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(light.energy[c], whole[c], 1e-12 * whole[c]);
    Vec3d sum;
    for (const LightCell& cell : light.cells) {
      sum += cell.energy;
      EXPECT_LE(length(cell.centre), 1 + 1e-12);
    }
    EXPECT_NEAR(sum.y, whole.y, 1e-12 * whole.y);
  }
}

// What the error of a light set is measured against, by a sum over texels cut fine. A cell has one
// centre for three channels: where colour varies across it, by 0.4 a radian here, the centre of one
// channel lies 0.4 h^2 / 3 = 3e-5 off, h = 0.9 degrees.
TEST(LightCells, GiveTheIrradianceOfTheMap) {
  const Environment environment = environment_of(reference::test_sky(300, 1e4));
  const LightCells light = gather(environment);
  for (const Vec3d& n : {Vec3d{0, 1, 0}, Vec3d{1, 0, 0}, Vec3d{0, 0, -1}, Vec3d{0.6, -0.8, 0}}) {
    const Vec3d truth = reference::irradiance(environment.radiance, n);
    const Vec3d found = cell_irradiance(light, n);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], truth[c], 5e-5 * light.energy[c] / 4);
  }
}

TEST(LightSet, ConservesEnergyInEveryChannel) {
  const Environment environment = environment_of(reference::test_sky(64, 1e5));
  const Vec3d whole = energy_of(environment.radiance);
  const LightCells light = gather(environment);
  for (const LightSplit how : kSplits) {
    for (const int count : {1, 2, 3, 7, 64, 256}) {
      const auto lights = split(light, count, how);
      EXPECT_EQ(lights.size(), static_cast<size_t>(count));
      Vec3d sum;
      double last = HUGE_VAL;
      for (const DirectionalLight& l : lights) {
        sum += l.irradiance;
        EXPECT_NEAR(length(l.direction), 1, 1e-12);
        EXPECT_LE(luminance(l.irradiance), last);
        last = luminance(l.irradiance);
      }
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], whole[c], 1e-12 * whole[c]);
    }
  }
}

TEST(LightSet, IsTheTexelItselfWhereOneIsHot) {
  Image map(64, 32, 3);
  std::fill_n(map.at(9, 5), 3, 7.0f);
  const LightCells light = gather(environment_of(map));
  Progress progress;
  const IrradianceReference reference(light, 1, progress);
  for (const LightSplit how : kSplits) {
    const auto lights = split(light, 16, how);
    ASSERT_EQ(lights.size(), 1u);
    const Vec3d d = latlong_direction(9.5 / 64, 5.5 / 32);
    EXPECT_NEAR(dot(lights[0].direction, d), 1, 1e-4);
    // Its own width: evenly lit over +-h it gives E h / 4 where its centre is on the horizon, and
    // the mean irradiance is E / 4.
    EXPECT_LE(reference.error(lights).max, light.cells[0].extent);
  }
}

TEST(LightSet, IsEmptyForABlackMap) {
  const LightCells light = gather(environment_of(map_of(16, {0, 0, 0})));
  for (const LightSplit how : kSplits) EXPECT_TRUE(split(light, 8, how).empty());
  Progress progress;
  EXPECT_EQ(IrradianceReference(light, 1, progress).error({}).max, 0);
}

// Radiance L from everywhere gives pi L to every normal, one light of 4 pi L gives 4 pi L max(0, c)
// with c uniform in [-1, 1]: relative to pi L the error 4 max(0, c) - 1 has the mean square
// 16/6 - 8/4 + 1 and the maximum 3.
TEST(LightSet, HasTheKnownErrorOfOneLightForAConstantMap) {
  const LightCells light = gather(environment_of(map_of(64, {0.3f, 0.3f, 0.3f})));
  Progress progress;
  const IrradianceReference reference(light, 1, progress);
  const IrradianceError error = reference.error(split(light, 1, LightSplit::clusters));
  EXPECT_NEAR(error.rms, std::sqrt(5.0 / 3), 2e-3);
  EXPECT_NEAR(error.max, 3, 0.02);
  EXPECT_NEAR(cell_irradiance(light, {0, 1, 0}).x, kPi * 0.3, 1e-4);
}

// Clusters win over both cuts, and more lights pay.
TEST(LightSet, ErrsLessThanMedianCut) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* name : kMaps) {
    const LightCells light = gather(real_map(data, name));
    Progress progress;
    const IrradianceReference reference(light, 1, progress);
    double median = 0, variance = 0, clusters = 0, last = HUGE_VAL;
    for (const int count : {2, 8, 32, 256}) {
      const auto rms = [&](LightSplit how) {
        return reference.error(split(light, count, how)).rms;
      };
      const double best = rms(LightSplit::clusters), debevec = rms(LightSplit::median_cut);
      EXPECT_LT(best, last) << name << " " << count;
      EXPECT_LT(best, debevec) << name << " " << count;
      last = best;
      median += std::log(debevec);
      variance += std::log(rms(LightSplit::variance_cut));
      clusters += std::log(best);
    }
    EXPECT_LT(clusters, variance) << name;
    EXPECT_LT(variance, median) << name;
    EXPECT_LT(last, 2e-3) << name;
  }
}

TEST(LightSet, DoesNotDependOnThreads) {
  const Environment environment = environment_of(reference::test_sky(96, 1e4));
  Progress progress;
  std::vector<std::vector<DirectionalLight>> results;
  for (const int threads : {1, 2, 7}) {
    results.push_back(split_lights(gather_light(environment, threads, progress), 50,
                                   LightSplit::clusters, threads, progress));
  }
  for (const auto& lights : results) {
    ASSERT_EQ(lights.size(), results[0].size());
    for (size_t i = 0; i < lights.size(); ++i) {
      EXPECT_EQ(lights[i].direction, results[0][i].direction);
      EXPECT_EQ(lights[i].irradiance, results[0][i].irradiance);
    }
  }
}

}  // namespace
}  // namespace lightkiln
