#include "core/environment/sampler.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/environment/light_cells.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/environment/made_maps.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::environment_of;

Image map_of(int height, float value) {
  return test::map_of(height, {value, value, value});
}

// The upper tail of chi-square by Wilson and Hilferty's cube root.
double chi_square_p(double statistic, double degrees) {
  const double k = 2 / (9 * degrees);
  const double z = (std::cbrt(statistic / degrees) - (1 - k)) / std::sqrt(k);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

// Draws independent directions and counts them in a 36 x 18 grid of equal steps in longitude and
// cos theta; the expectation is the density integrated by looking pdf() up on a fine grid.
double chi_square(const EnvironmentSampler& sampler, double tilt = 1.0) {
  constexpr int kColumns = 36, kRows = 18, kDraws = 40000, kFine = 24;
  std::vector<double> observed(kColumns * kRows), expected(kColumns * kRows);
  const auto cell = [&](const Vec3& d) {
    double u = 0, v = 0;
    latlong_coordinates(to_double(d), &u, &v);
    const int row = std::min(kRows - 1, static_cast<int>((1 - std::cos(kPi * v)) / 2 * kRows));
    return static_cast<size_t>(row * kColumns +
                               std::min(kColumns - 1, static_cast<int>(u * kColumns)));
  };
  for (uint64_t i = 0; i < kDraws; ++i) {
    const float u = to_unit_float(static_cast<uint32_t>(hash64(2 * i)));
    const float v = to_unit_float(static_cast<uint32_t>(hash64(2 * i + 1)));
    observed[cell(sampler.sample(static_cast<float>(std::pow(u, tilt)), v).direction)] += 1;
  }
  for (int row = 0; row < kRows * kFine; ++row) {
    for (int column = 0; column < kColumns * kFine; ++column) {
      const double y = 1 - 2 * (row + 0.5) / (kRows * kFine);
      const double v = std::acos(y) / kPi, u = (column + 0.5) / (kColumns * kFine);
      const double share = 4 * kPi / (kRows * kFine * kColumns * kFine) *
                           double(sampler.pdf(to_float(latlong_direction(u, v))));
      expected[static_cast<size_t>(row / kFine * kColumns + column / kFine)] += share * kDraws;
    }
  }
  double statistic = 0, pooled_seen = 0, pooled_expected = 0;
  int degrees = -1;
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] < 8) {
      pooled_seen += observed[i];
      pooled_expected += expected[i];
      continue;
    }
    statistic += (observed[i] - expected[i]) * (observed[i] - expected[i]) / expected[i];
    ++degrees;
  }
  if (pooled_expected > 8) {
    statistic +=
        (pooled_seen - pooled_expected) * (pooled_seen - pooled_expected) / pooled_expected;
    ++degrees;
  }
  return degrees > 0 ? chi_square_p(statistic, degrees) : 1;
}

// The density is constant over a texel, so that one value a texel integrates it.
double integral_of_density(const EnvironmentSampler& sampler, const Image& map) {
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / map.width, (y + 0.5) / map.height);
      sum += double(sampler.pdf(to_float(d))) * latlong_texel_solid_angle(y, map.width, map.height);
    }
  }
  return sum;
}

// Maps whose texels meet the grid's cells exactly, so that the expectation is exact too.
TEST(Sampler, DrawsFromItsDensityOnSmoothMaps) {
  for (const int height : {1, 9, 18}) {
    Image map = map_of(height, 0.2f);
    for (size_t i = 0; i < map.pixels.size(); ++i) {
      map.pixels[i] = 0.2f + float(hash64(i) & 15);
    }
    const Environment environment = environment_of(map);
    const EnvironmentSampler sampler(environment);
    EXPECT_GT(chi_square(sampler), 1e-4) << height;
    EXPECT_NEAR(integral_of_density(sampler, environment.radiance), 1, 1e-6) << height;
  }
}

TEST(Sampler, WouldFailTheTestWithATiltedDraw) {
  const Environment environment = environment_of(map_of(18, 1));
  EXPECT_GT(chi_square(EnvironmentSampler(environment)), 1e-4);
  EXPECT_LT(chi_square(EnvironmentSampler(environment), 1.15), 1e-4);
}

// Exact on any map, texel by texel: counts of the texels that hold the drawn directions against
// what their luminance above the floor and their solid angle give them; the density that comes
// with each draw against the same.
double texel_chi_square(const Environment& environment, double floor = 0) {
  const EnvironmentSampler sampler(environment, floor);
  const Image& map = environment.radiance;
  std::vector<double> shares, counts(map.pixels.size() / 3);
  double total = 0;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    for (int x = 0; x < map.width; ++x) {
      shares.push_back(std::max(0.0, luminance(to_double(map.rgb(x, y))) - floor) * omega);
      total += shares.back();
    }
  }
  constexpr int kDraws = 60000;
  int wrong = 0;
  for (uint64_t i = 0; i < kDraws; ++i) {
    const float a = to_unit_float(static_cast<uint32_t>(hash64(7000001 + 2 * i)));
    const float b = to_unit_float(static_cast<uint32_t>(hash64(7000002 + 2 * i)));
    const auto sample = sampler.sample(a, b);
    double u = 0, v = 0;
    latlong_coordinates(to_double(sample.direction), &u, &v);
    const int x = static_cast<int>(u * map.width);
    const int y = std::min(map.height - 1, static_cast<int>(v * map.height));
    const auto texel = static_cast<size_t>(y * map.width + x);
    counts[texel] += 1;
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    const double density = shares[texel] / total / omega;
    const bool right = std::abs(double(sample.pdf) / density - 1) < 1e-5 &&
                       sampler.pdf(sample.direction) == sample.pdf;
    wrong += right ? 0 : 1;
  }
  EXPECT_EQ(wrong, 0);
  double statistic = 0, rest_seen = 0, rest_expected = 0;
  int degrees = -1;
  for (size_t i = 0; i < counts.size(); ++i) {
    const double expected = shares[i] / total * kDraws;
    if (expected < 8) {
      rest_seen += counts[i];
      rest_expected += expected;
    } else {
      statistic += (counts[i] - expected) * (counts[i] - expected) / expected;
      ++degrees;
    }
  }
  if (rest_expected > 8) {
    statistic += (rest_seen - rest_expected) * (rest_seen - rest_expected) / rest_expected;
    ++degrees;
  }
  return degrees > 0 ? chi_square_p(statistic, degrees) : 1;
}

TEST(Sampler, DrawsFromItsDensityOnOddMaps) {
  Image sun = reference::test_sky(40, 1e5);
  EXPECT_GT(texel_chi_square(environment_of(sun)), 1e-4);
  Image pole = map_of(16, 0.01f);
  for (int x = 0; x < 32; ++x) std::fill_n(pole.at(x, 15), 3, 50.0f);
  EXPECT_GT(texel_chi_square(environment_of(pole)), 1e-4);
  Image gaps = map_of(8, 0);
  for (int y = 1; y < 8; y += 3) std::fill_n(gaps.at(y, y), 3, 1.0f);
  EXPECT_GT(texel_chi_square(environment_of(gaps)), 1e-4);
}

// Every lat-long map of the data set, with the whole density and with what a companion leaves.
TEST(Sampler, DrawsFromItsDensityOnEveryRealMap) {
  LIGHTKILN_NEEDS_DATA(data);
  int maps = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data / "environments")) {
    if (!entry.is_regular_file()) continue;
    const DecodedImage decoded = decode_hdr_image(test::read_file(entry.path()));
    if (decoded.image.width != 2 * decoded.image.height) continue;  // cubes and balls
    const Environment environment = make_environment(decoded);
    EXPECT_GT(texel_chi_square(environment), 1e-4) << entry.path();
    EXPECT_GT(texel_chi_square(environment, mis_compensation_floor(environment)), 1e-4)
        << entry.path();
    ++maps;
  }
  EXPECT_EQ(maps, 15);
}

// E5
TEST(Sampler, StaysInsideOneHotTexel) {
  Image map(64, 32, 3);
  map.at(63, 0)[1] = 2;
  const Environment environment = environment_of(map);
  const EnvironmentSampler sampler(environment);
  const double omega = latlong_texel_solid_angle(0, 64, 32);
  const float ends[] = {0, 0x1p-24f, 0.5f, 1 - 0x1p-24f};
  for (const float u : ends) {
    for (const float v : ends) {
      const auto sample = sampler.sample(u, v);
      EXPECT_EQ(environment_radiance(environment, sample.direction).y, 2);
      EXPECT_EQ(sample.radiance.y, 2);
      EXPECT_NEAR(sample.pdf * omega, 1, 1e-6);
      EXPECT_EQ(sampler.pdf(sample.direction), sample.pdf);
      EXPECT_NEAR(length(sample.direction), 1, 1e-6);
    }
  }
  EXPECT_EQ(sampler.pdf({0, -1, 0}), 0);
}

// E6: u and v on the edges of [0, 1) at the poles: density and direction stay finite.
TEST(Sampler, StaysFiniteAtThePoles) {
  Image map = map_of(16, 1);
  for (int x = 0; x < 32; ++x) std::fill_n(map.at(x, 0), 3, 1e4f);
  const Environment environment = environment_of(map);
  const EnvironmentSampler sampler(environment);
  for (const float u : {0.0f, 1 - 0x1p-24f}) {
    for (const float v : {0.0f, 0x1p-24f, 1 - 0x1p-24f}) {
      const auto sample = sampler.sample(u, v);
      EXPECT_TRUE(std::isfinite(sample.pdf) && sample.pdf > 0);
      EXPECT_TRUE(is_finite(sample.direction));
    }
  }
  EXPECT_TRUE(std::isfinite(sampler.pdf({0, 1, 0})) && sampler.pdf({0, 1, 0}) > 0);
}

// E4
TEST(Sampler, IsUniformOnABlackMap) {
  const Environment environment = environment_of(map_of(8, 0));
  const EnvironmentSampler sampler(environment);
  EXPECT_TRUE(sampler.black());
  EXPECT_NEAR(sampler.pdf({1, 0, 0}), 1 / (4 * kPi), 1e-8);
  EXPECT_EQ(sampler.sample(0.3f, 0.9f).radiance, Vec3{});
  EXPECT_GT(chi_square(sampler), 1e-4);
  // Positive control: a single lit texel, however dim, is no black map.
  Image dim = map_of(8, 0);
  dim.at(3, 3)[2] = 1e-30f;
  const Environment lit = environment_of(dim);
  EXPECT_FALSE(EnvironmentSampler(lit).black());
  EXPECT_EQ(EnvironmentSampler(lit).pdf({0, 1, 0}), 0);
}

TEST(Sampler, GivesAConstantMapTheUniformDensity) {
  const Environment environment = constant_environment({2, 2, 2});
  const EnvironmentSampler sampler(environment);
  for (const float u : {0.0f, 0.4f, 0.999f}) {
    EXPECT_NEAR(sampler.sample(u, u).pdf, 1 / (4 * kPi), 1e-7);
  }
  EXPECT_GT(chi_square(sampler), 1e-4);
}

// The first texel outshines each of two million others by 5e7, yet they hold 2.6 % of the light.
Image sun_before_many(int height) {
  Image map = map_of(height, 0.01f);
  const double ratio = latlong_texel_solid_angle(height / 2, 2 * height, height) /
                       latlong_texel_solid_angle(0, 2 * height, height);
  std::fill_n(map.at(0, 0), 3, static_cast<float>(0.01 * 5e7 * ratio));
  return map;
}

// E8
TEST(Sampler, KeepsDimTexelsBehindASun) {
  const Environment environment = environment_of(sun_before_many(1024));
  const EnvironmentSampler sampler(environment);
  for (int y = 0; y < 1024; y += 31) {
    for (int x = 0; x < 2048; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / 2048, (y + 0.5) / 1024);
      ASSERT_GT(sampler.pdf(to_float(d)), 0);
    }
  }
  EXPECT_GT(texel_chi_square(environment), 1e-4);
}

// The control: with running sums in float those texels are lost, and the draws show it.
TEST(Sampler, WouldLoseThemToAFloatSum) {
  const Environment environment = environment_of(sun_before_many(1024));
  const Image& map = environment.radiance;
  float running = 0;
  size_t lost = 0;
  double dim = 0, all = 0;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    for (int x = 0; x < map.width; ++x) {
      const double weight = luminance(to_double(map.rgb(x, y))) * omega;
      const float next = running + static_cast<float>(weight);
      lost += next == running ? 1 : 0;
      running = next;
      all += weight;
      dim += x + y > 0 ? weight : 0;
    }
  }
  EXPECT_EQ(lost, map.pixels.size() / 3 - 1);
  const double expected = dim / all * 60000;  // of as many draws as the test above makes
  EXPECT_GT(expected, 1000);
  EXPECT_LT(chi_square_p(expected * expected / expected, 1), 1e-4);
}

// Light / density has no variance where the map has one colour: a white furnace stays exact.
TEST(Sampler, IntegratesTheMapItself) {
  const Environment environment = environment_of(reference::test_sky(24, 1e4));
  const EnvironmentSampler sampler(environment);
  double sum = 0;
  constexpr uint32_t kCount = 4096;
  for (uint32_t i = 0; i < kCount; ++i) {
    const Point2 p = sobol2(11, i);
    const auto sample = sampler.sample(p.x, p.y);
    sum += luminance(to_double(sample.radiance)) / double(sample.pdf);
  }
  EXPECT_NEAR(sum / kCount / (4 * kPi), luminance(environment.mean),
              1e-6 * luminance(environment.mean));
}

// Irradiance of a facing floor by one cosine-weighted and one light sample under the balance
// heuristic, `count` times.
struct Estimate {
  double mean = 0, variance = 0;
};
Estimate irradiance_by_mis(const Environment& environment, const EnvironmentSampler& sampler,
                           const Vec3d& normal) {
  constexpr uint32_t kCount = 1 << 13;
  const Basis<double> basis = make_basis(normal);
  RunningMoments moments;
  const auto weighed = [&](const Vec3d& d) {
    const double cosine = dot(d, normal);
    if (!(cosine > 0)) return 0.0;
    const Vec3 direction = to_float(d);
    const double light = luminance(to_double(environment_radiance(environment, direction)));
    return light * cosine / (cosine / kPi + double(sampler.pdf(direction)));
  };
  for (uint32_t i = 0; i < kCount; ++i) {
    const auto u = [i](uint32_t k) {
      return to_unit_float(static_cast<uint32_t>(hash64(hash_combine(k, i))));
    };
    const double r = std::sqrt(double(u(0))), phi = 2 * kPi * double(u(1));
    const Vec3d cosine_sample =
        basis.to_world({r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0, 1 - r * r))});
    moments.add(weighed(cosine_sample) + weighed(to_double(sampler.sample(u(2), u(3)).direction)));
  }
  return {moments.mean, moments.variance() / kCount};
}

TEST(MisCompensation, IsUnbiasedAndLessNoisy) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* name : {"kloppenheim_05_1k.hdr", "spiaggia_di_mondello_1k.hdr",
                           "vestibule_1k.hdr", "studio_small_05_1k.hdr"}) {
    const Environment environment = make_environment(
        decode_hdr_image(test::read_file(data / "environments/latlong_hdr" / name)));
    const double floor = mis_compensation_floor(environment);
    EXPECT_GE(floor, 0.5 * luminance(environment.mean) * (1 - 1e-9));
    EXPECT_LE(floor, luminance(environment.mean));
    const EnvironmentSampler plain(environment), compensated(environment, floor);
    Progress progress;
    const LightCells light = gather_light(environment, 1, progress);
    double before = 0, after = 0;
    for (const Vec3d& n : {Vec3d{0, 1, 0}, Vec3d{1, 0, 0}, Vec3d{0, 0.6, -0.8}, Vec3d{-0.6, 0.8, 0},
                           Vec3d{0, -0.8, 0.6}, Vec3d{0, 0, 1}}) {
      const double truth = luminance(cell_irradiance(light, n));
      const Estimate a = irradiance_by_mis(environment, plain, n);
      const Estimate b = irradiance_by_mis(environment, compensated, n);
      EXPECT_NEAR(a.mean, truth, 5 * std::sqrt(a.variance)) << name;
      EXPECT_NEAR(b.mean, truth, 5 * std::sqrt(b.variance)) << name;
      before += a.variance / (truth * truth);
      after += b.variance / (truth * truth);
    }
    EXPECT_LT(after, before) << name;
  }
}

// By itself the compensated sampler never looks at dim texels: its estimate alone is short of them.
TEST(MisCompensation, WouldBeBiasedAlone) {
  const Environment environment = environment_of(reference::test_sky(24, 1e4));
  const EnvironmentSampler sampler(environment, mis_compensation_floor(environment));
  double sum = 0;
  constexpr uint32_t kCount = 4096;
  for (uint32_t i = 0; i < kCount; ++i) {
    const Point2 p = sobol2(11, i);
    const auto sample = sampler.sample(p.x, p.y);
    sum += luminance(to_double(sample.radiance)) / double(sample.pdf);
  }
  EXPECT_LT(sum / kCount / (4 * kPi), 0.99 * luminance(environment.mean));
}

TEST(MisCompensation, SolvesItsEquation) {
  const Environment environment = environment_of(reference::test_sky(24, 1e3));
  const double floor = mis_compensation_floor(environment);
  double over = 0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 48; ++x) {
      const double l = luminance(to_double(environment.radiance.rgb(x, y)));
      over += std::max(0.0, l - floor) * latlong_texel_solid_angle(y, 48, 24) / (4 * kPi);
    }
  }
  EXPECT_NEAR(over, floor, 1e-10 * floor);
  EXPECT_EQ(mis_compensation_floor(environment_of(map_of(8, 0))), 0);
  const Environment grey = constant_environment({2, 2, 2});
  EXPECT_NEAR(mis_compensation_floor(grey), 1, 1e-12);
  EXPECT_NEAR(EnvironmentSampler(grey, 1.0).pdf({0, 1, 0}), 1 / (4 * kPi), 1e-8);
}

}  // namespace
}  // namespace lightkiln
