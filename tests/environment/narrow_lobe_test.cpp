// Lobes too narrow for bands, sheen, and what no result may depend on.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/environment/bright_light.h"
#include "core/environment/charlie_lobe.h"
#include "core/environment/ggx_lobe.h"
#include "core/environment/near_field.h"
#include "core/environment/patch_integral.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/environment/convolved.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::convolve;
using test::environment_of;
using test::Level;

Vec3d brightest_direction(const Image& map) {
  Vec3d result;
  float brightest = -1;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (map.rgb(x, y).y <= brightest) continue;
      brightest = map.rgb(x, y).y;
      result = latlong_direction((x + 0.5) / map.width, (y + 0.5) / map.height);
    }
  }
  return result;
}

// Texels to compare: spread over the cube, and those around a direction.
std::vector<std::pair<int, int>> places(int size, int count, const Vec3d& around) {
  std::vector<std::pair<int, int>> result;
  for (int i = 0; i < count; ++i) {
    const int texel = (i * 7919 + 13) % (6 * size * size);
    result.push_back({texel % size, texel / size});
  }
  for (int y = 0; y < 6 * size; ++y) {
    for (int x = 0; x < size; ++x) {
      if (dot(cube_texel_direction(y / size, x, y % size, size), around) > std::cos(2.2 / size))
        result.push_back({x, y});
    }
  }
  return result;
}

template <typename Twin>
double worst_relative(const Level& level, int size, const Vec3d& around, int count,
                      const Twin& twin) {
  double worst = 0;
  for (const auto& [x, y] : places(size, count, around)) {
    const Vec3d truth = twin(cube_texel_direction(y / size, x, y % size, size));
    for (int c = 0; c < 3; ++c) {
      worst = std::max(worst, std::abs(double(level.cube.rgb(x, y)[c]) - truth[c]) / truth[c]);
    }
  }
  return worst;
}

// alpha from a fortieth of a texel to half of one; the sun is 1e5 times the sky.
TEST(NarrowLobe, EqualsBruteForceUnderASun) {
  const int size = 16;
  const Environment sky = environment_of(reference::test_sky(48, 1e5));
  const Vec3d sun = brightest_direction(sky.radiance);
  for (const double roughness : {0.035, 0.05, 0.09}) {
    const double alpha = roughness * roughness;
    const Level level = convolve(sky, {LobeKind::ggx, alpha}, size, 1e-4);
    EXPECT_GT(level.plan.split, 0) << roughness;
    EXPECT_LE(level.plan.error_bound, 1e-4) << roughness;
    const auto twin = [&](const Vec3d& d) {
      return test::slow_average(sky, {LobeKind::ggx, alpha}, d);
    };
    EXPECT_LT(worst_relative(level, size, sun, 16, twin), 1e-5) << roughness;
    // Positive control: without its core the lobe misses most of the light.
    LobePlan hollow = level.plan;
    hollow.split = 0;
    EXPECT_GT(worst_relative(convolve(sky, hollow, size), size, sun, 16, twin), 0.1) << roughness;
  }
}

// X1: No roughness is too low: the level tends to the source texel, finite all the way.
TEST(NarrowLobe, TendsToTheSource) {
  const Environment sky = environment_of(reference::test_sky(32, 100));
  const int size = 24;
  const Level level = convolve(sky, {LobeKind::ggx, 1e-8}, size, 1e-4);
  int compared = 0;
  for (int y = 0; y < 6 * size; ++y) {
    for (int x = 0; x < size; ++x) {
      double u = 0, v = 0;
      latlong_coordinates(cube_texel_direction(y / size, x, y % size, size), &u, &v);
      const double fx = u * 64 - std::floor(u * 64), fy = v * 32 - std::floor(v * 32);
      for (const float value : {level.cube.rgb(x, y).x, level.cube.rgb(x, y).z}) {
        ASSERT_TRUE(std::isfinite(value) && value >= 0);
      }
      if (std::min({fx, fy, 1 - fx, 1 - fy}) < 0.1 || v < 0.1 || v > 0.9) continue;
      const float source = sky.radiance.rgb(static_cast<int>(u * 64), static_cast<int>(v * 32)).x;
      ASSERT_NEAR(level.cube.rgb(x, y).x, source, 2e-6 * source);
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);
}

// The core integrates to what is missing in the halo: a white map stays white, poles and seam
// included, without the range doing it.
TEST(NarrowLobe, KeepsAWhiteMapWhite) {
  Image white(128, 64, 3);
  for (float& v : white.pixels) v = 1;
  const double split = 3e4;
  for (const double alpha : {1e-6, 1e-3, 0.005}) {
    const NearField near(white, alpha, split, 1e-7);
    const double halo = band_responses(GgxHalo(alpha, split), 2)[0];
    NearField::Workspace work;
    for (const Vec3d& d : {Vec3d{0, 1, 0}, Vec3d{0.001, -1, 0.002}, Vec3d{1e-9, 0, -1},
                           Vec3d{0.3, 0.5, 0.8}, Vec3d{-1, 0.01, 0}, Vec3d{0.02, 0.9, 0.01}}) {
      EXPECT_NEAR(near.at(normalize(d), work).x + halo, 1, 2e-6) << alpha;
    }
  }
}

TEST(NarrowLobe, GivesTheSameBitsForAnyNumberOfThreads) {
  const Environment sky = environment_of(reference::test_sky(32, 1e4));
  const LightStatistics light = measure_light(sky);
  const LobePlan plan = plan_lobe(light, {LobeKind::ggx, 0.002}, 1e-3);
  std::vector<float> first;
  for (const int threads : {1, 3}) {
    Progress progress;
    const LatlongSpectrum spectrum = project_for(sky, {&plan, 1}, 1, threads, progress);
    const Image cube = convolve_lobe(sky, light, spectrum, plan, 8, threads, progress);
    if (first.empty()) first = cube.pixels;
    EXPECT_EQ(cube.pixels, first);
  }
}

TEST(Sheen, EqualsBruteForceUnderASun) {
  const int size = 16;
  const Environment sky = environment_of(reference::test_sky(64, 1e5));
  const Vec3d sun = brightest_direction(sky.radiance);
  // Where the ring meets the sun.
  const Vec3d beside = normalize(cross(sun, Vec3d{0, 1, 0}));
  for (const double roughness : {0.3, 0.6, 1.0}) {
    const double alpha = roughness * roughness;
    const Level level = convolve(sky, {LobeKind::charlie, alpha}, size, 1e-5);
    const auto twin = [&](const Vec3d& d) {
      return test::slow_average(sky, {LobeKind::charlie, alpha}, d);
    };
    EXPECT_LT(worst_relative(level, size, beside, 8, twin), 5e-4) << roughness;
    for (const float v : level.cube.pixels) ASSERT_GE(v, 0);
    // Positive control: GGX of the same roughness is another picture.
    const Level ggx = convolve(sky, {LobeKind::ggx, alpha}, size, 1e-4);
    EXPECT_GT(worst_relative(ggx, size, beside, 2, twin), 0.05) << roughness;
  }
}

// Where a lobe's horizon crosses the sun, its kink does: the mean over the sun's texel, not the
// value at its centre.
TEST(Sheen, EqualsBruteForceWhereItsHorizonCutsTheSun) {
  const int size = 24;
  Image map = reference::test_sky(32, 1);
  for (int c = 0; c < 3; ++c) map.at(11, 5)[c] = 3e4f;
  const Environment sky = environment_of(map);
  const Vec3d sun = latlong_direction(11.5 / 64, 5.5 / 32);
  const double mean = luminance(sky.mean);
  for (const double roughness : {0.2, 0.5}) {
    const double alpha = roughness * roughness;
    const Level level = convolve(sky, {LobeKind::charlie, alpha}, size, 1e-4);
    ASSERT_TRUE(level.plan.corrected);
    const CharlieLobe lobe(alpha);
    const auto twin = make_twin_lobe({LobeKind::charlie, alpha});
    const double energy =
        luminance(to_double(map.rgb(11, 5))) * latlong_texel_solid_angle(5, 64, 32);
    double worst = 0, worst_at_centre = 0;
    int compared = 0;
    for (int i = 0; i < 6 * size * size && compared < 12; ++i) {
      const int texel = (i * 7919 + 13) % (6 * size * size), x = texel % size, y = texel / size;
      const Vec3d d = cube_texel_direction(y / size, x, y % size, size);
      if (std::abs(dot(d, sun)) > 0.05) continue;
      const Vec3d truth = test::slow_average(sky, {LobeKind::charlie, alpha}, d);
      const double error = luminance(to_double(level.cube.rgb(x, y)) - truth);
      worst = std::max(worst, std::abs(error) / mean);
      // Positive control: the sun as a point at its texel's centre.
      const double step = kPi / 32;
      const double left = std::remainder(kPi - 12 * step - std::atan2(d.x, d.z), 2 * kPi);
      const PatchIntegral patches(*twin, std::acos(d.y));
      const double over = patches({5 * step, 6 * step, left, left + step});
      const double point = lobe(dot(d, sun)) * latlong_texel_solid_angle(5, 64, 32);
      worst_at_centre = std::max(worst_at_centre, std::abs(over - point) * energy /
                                                      latlong_texel_solid_angle(5, 64, 32) / mean);
      ++compared;
    }
    EXPECT_EQ(compared, 12);
    EXPECT_LT(worst, 2e-4) << roughness;
    EXPECT_GT(worst_at_centre, 0.05) << roughness;
  }
}

// Under an unclipped sun an order is met, not given up: the sun's part is in closed form and counts
// with what its cells leave.
TEST(Sheen, MeetsItsOrderUnderAnUnclippedSun) {
  LIGHTKILN_NEEDS_DATA(data);
  const Environment sky = make_environment(decode_hdr_image(
      test::read_file(data / "environments" / "latlong_hdr" / "kloppenheim_05_1k.hdr")));
  const LightStatistics light = measure_light(sky);
  ASSERT_GT(light.spread, 100);
  for (const double order : {1e-2, 1e-3}) {
    for (const double ordered : {0.07, 0.1, 0.2, 0.3}) {
      const double roughness = std::max(ordered, kMinSheenRoughness);
      const Lobe lobe{LobeKind::charlie, roughness * roughness};
      const LobePlan plan = plan_lobe(light, lobe, 0.1 * order);
      EXPECT_LE(plan.error_bound, 0.5 * order) << ordered;
      EXPECT_LE(cut_light_points(light, plan.bands, plan.cell_phase), 384) << ordered;
      // Positive control: without the closed form it would not be.
      EXPECT_GT(plan.uncorrected_bound, order) << ordered;
    }
  }
}

// What the cells of the bright texels leave, against cells a fifth as large.
TEST(CutLight, StaysWithinItsBound) {
  Image map = reference::test_sky(32, 1);
  for (int c = 0; c < 3; ++c) map.at(11, 5)[c] = 3e4f;
  const Environment sky = environment_of(map);
  const LightStatistics light = measure_light(sky);
  ASSERT_EQ(light.bright.size(), 1u);
  for (const auto kind : {LobeKind::charlie, LobeKind::ggx}) {
    const auto kernel = make_kernel({kind, 0.09});
    const std::vector<double> responses = band_responses(*kernel, 500);
    const int bands = 60;
    const std::vector<double> kept(responses.begin(), responses.begin() + bands);
    const CutLight fine(light, *kernel, kept, 0.2);
    double last = 1;
    for (const double phase : {4.0, 2.0, 1.0}) {
      const CutLight coarse(light, *kernel, kept, phase);
      double squares = 0;
      constexpr int kCount = 4000;
      for (int i = 0; i < kCount; ++i) {  // Fibonacci's spiral
        const double y = 1 - (2 * i + 1.0) / kCount, phi = 2.399963229728653 * i;
        const double ring = std::sqrt(1 - y * y);
        const Vec3d d{ring * std::sin(phi), y, ring * std::cos(phi)};
        const Vec3d error = (coarse.at(d) - fine.at(d)) / light.mean_luminance;
        squares += std::pow(luminance(error), 2);
      }
      const double rms = std::sqrt(squares / kCount);
      const double bound = cut_light_bound(light, *kernel, responses, bands, phase);
      EXPECT_LE(rms, bound) << phase;
      EXPECT_LE(bound, last) << phase;
      last = bound;
    }
  }
}

// One sky at two resolutions, texels of the coarse one being means of the fine one's; the sun
// covers whole texels of both. Levels differ by no more than both bounds allow, and nowhere by
// 1e-3.
TEST(Levels, DoNotDependOnTheInputsResolution) {
  Image fine = reference::test_sky(256, 1);
  for (int y = 60; y < 64; ++y) {
    for (int x = 200; x < 204; ++x) {
      for (int c = 0; c < 3; ++c) fine.at(x, y)[c] = 2e5f;
    }
  }
  Image coarse(256, 128, 3);
  for (int y = 0; y < 128; ++y) {
    const double upper = std::sin(kPi * (2 * y + 0.5) / 256),
                 lower = std::sin(kPi * (2 * y + 1.5) / 256);
    for (int x = 0; x < 256; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double top = double(fine.at(2 * x, 2 * y)[c]) + double(fine.at(2 * x + 1, 2 * y)[c]);
        const double bottom =
            double(fine.at(2 * x, 2 * y + 1)[c]) + double(fine.at(2 * x + 1, 2 * y + 1)[c]);
        coarse.at(x, y)[c] =
            static_cast<float>(0.5 * (top * upper + bottom * lower) / (upper + lower));
      }
    }
  }
  const Environment a = environment_of(fine), b = environment_of(coarse);
  const int size = 16;
  for (const double alpha : {0.25, 1.0}) {
    const Level large = convolve(a, {LobeKind::ggx, alpha}, size, 1e-5);
    const Level small = convolve(b, {LobeKind::ggx, alpha}, size, 1e-5);
    double squares = 0;
    for (size_t i = 0; i < large.cube.pixels.size(); ++i) {
      const double difference = double(small.cube.pixels[i]) - double(large.cube.pixels[i]);
      ASSERT_NEAR(difference / double(large.cube.pixels[i]), 0, 1e-3) << alpha;
      squares += difference * difference;
    }
    const double rms = std::sqrt(squares / static_cast<double>(large.cube.pixels.size()));
    EXPECT_LT(rms, (large.plan.error_bound + small.plan.error_bound) * luminance(a.mean)) << alpha;
  }
}

// A sun of one energy as 1, 4 and 16 texels a side about the same direction.
TEST(Levels, DoNotDependOnTheSunsSizeInPixels) {
  const int size = 16;
  const double alpha = 0.25;
  std::vector<float> first;
  for (const int texels : {2, 4, 8}) {
    Image map(512, 256, 3);
    for (float& v : map.pixels) v = 0.5f;
    double omega = 0;
    const int x0 = 200 - texels / 2, y0 = 80 - texels / 2;
    for (int y = y0; y < y0 + texels; ++y) {
      omega += texels * latlong_texel_solid_angle(y, 512, 256);
    }
    for (int y = y0; y < y0 + texels; ++y) {
      for (int x = x0; x < x0 + texels; ++x) {
        for (int c = 0; c < 3; ++c) map.at(x, y)[c] = static_cast<float>(3 / omega);
      }
    }
    const Level level = convolve(environment_of(map), {LobeKind::ggx, alpha}, size, 1e-5);
    if (first.empty()) first = level.cube.pixels;
    const double side = kPi / 256 * texels, allowed = side * side / (4 * alpha * alpha) / 3;
    for (size_t i = 0; i < first.size(); ++i) {
      ASSERT_NEAR(level.cube.pixels[i] / first[i], 1, allowed + 2e-4) << texels;
    }
    // Positive control: the bands alone ring under it.
    LobePlan bare = level.plan;
    bare.corrected = false;
    if (texels > 2) continue;
    ASSERT_TRUE(level.plan.corrected);
    double worst = 0;
    const Image rung = convolve(environment_of(map), bare, size).cube;
    for (size_t i = 0; i < first.size(); ++i) {
      worst = std::max(worst, std::abs(double(rung.pixels[i]) / double(first[i]) - 1));
    }
    EXPECT_GT(worst, allowed + 2e-4);
  }
}

// The first bands alone: what engines keep. The whole differs from them by what is told.
TEST(BandedIrradiance, IsItsBandsAndTellsWhatItLacks) {
  const Environment sky = environment_of(reference::test_sky(64, 1e3));
  const LightStatistics light = measure_light(sky);
  const int size = 16;
  Progress progress;
  const LobePlan whole = plan_lobe(light, {LobeKind::ggx, 1}, 1e-5);
  const LatlongSpectrum spectrum = project_for(sky, {&whole, 1}, 5, 1, progress);
  const Image exact = convolve_lobe(sky, light, spectrum, whole, size, 1, progress);
  for (const int bands : {1, 3, 5}) {
    const Image cube = convolve_lobe(sky, light, spectrum,
                                     plan_irradiance_bands(light, bands, 1e-4), size, 1, progress);
    const ShRgb sh = world_harmonics(spectrum, bands);
    double squares = 0, most = 0, omega = 0;
    for (int y = 0; y < 6 * size; ++y) {
      for (int x = 0; x < size; ++x) {
        const Vec3d d = cube_texel_direction(y / size, x, y % size, size);
        ASSERT_NEAR(cube.rgb(x, y).x, sh_irradiance(sh, d).x / kPi, 2e-6 * light.mean.x * 10);
        const double weight = cube_texel_solid_angle(x, y % size, size);
        const double difference =
            (double(cube.rgb(x, y).x) - double(exact.rgb(x, y).x)) / light.mean_luminance;
        squares += weight * difference * difference;
        omega += weight;
        most = std::max(most, std::abs(difference));
      }
    }
    const OmittedLight omitted = omitted_irradiance(light, spectrum, bands);
    EXPECT_GT(omitted.rms, 0.9 * std::sqrt(squares / omega)) << bands;
    EXPECT_LT(omitted.rms, 1.6 * std::sqrt(squares / omega) + 1e-3) << bands;
    EXPECT_GE(omitted.most, most) << bands;
  }
}

}  // namespace
}  // namespace lightkiln
