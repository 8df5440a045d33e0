#include "core/environment/sampler.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

Environment environment_of(const Image& image) {
  DecodedImage decoded;
  decoded.image = image;
  return make_environment(decoded);
}

Image map_of(int height, float value) {
  Image map(2 * height, height, 3);
  for (float& v : map.pixels) v = value;
  return map;
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
// the probabilities that pdf() times the texel's solid angle states.
double texel_chi_square(const Environment& environment) {
  const EnvironmentSampler sampler(environment);
  const Image& map = environment.radiance;
  constexpr int kDraws = 60000;
  std::map<std::pair<int, int>, double> seen;
  for (uint64_t i = 0; i < kDraws; ++i) {
    const float a = to_unit_float(static_cast<uint32_t>(hash64(7000001 + 2 * i)));
    const float b = to_unit_float(static_cast<uint32_t>(hash64(7000002 + 2 * i)));
    const auto sample = sampler.sample(a, b);
    double u = 0, v = 0;
    latlong_coordinates(to_double(sample.direction), &u, &v);
    seen[{static_cast<int>(u * map.width),
          std::min(map.height - 1, static_cast<int>(v * map.height))}] += 1;
    EXPECT_GT(sample.pdf, 0);
    EXPECT_TRUE(std::isfinite(sample.pdf));
  }
  double statistic = 0, rest_seen = 0, rest_expected = 0, total = 0;
  int degrees = -1;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    for (int x = 0; x < map.width; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / map.width, (y + 0.5) / map.height);
      const double share = double(sampler.pdf(to_float(d))) * omega;
      total += share;
      const auto found = seen.find({x, y});
      const double count = found == seen.end() ? 0 : found->second;
      const double expected = share * kDraws;
      if (expected < 8) {
        rest_seen += count;
        rest_expected += expected;
      } else {
        statistic += (count - expected) * (count - expected) / expected;
        ++degrees;
      }
    }
  }
  EXPECT_NEAR(total, 1, 1e-6);
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

TEST(Sampler, DrawsFromItsDensityOnRealMaps) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* name : {"latlong_hdr/kloppenheim_05_1k.hdr", "latlong_exr/blender_night.exr"}) {
    const auto file = test::read_file(data / "environments" / name);
    EXPECT_GT(texel_chi_square(make_environment(decode_hdr_image(file))), 1e-4) << name;
  }
}

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

// u and v on the edges of [0, 1) at the poles: density and direction stay finite.
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

TEST(Sampler, IsUniformOnABlackMap) {
  const Environment environment = environment_of(map_of(8, 0));
  const EnvironmentSampler sampler(environment);
  EXPECT_TRUE(sampler.black());
  EXPECT_NEAR(sampler.pdf({1, 0, 0}), 1 / (4 * kPi), 1e-8);
  EXPECT_EQ(sampler.sample(0.3f, 0.9f).radiance, Vec3{});
  EXPECT_GT(chi_square(sampler), 1e-4);
}

TEST(Sampler, GivesAConstantMapTheUniformDensity) {
  const Environment environment = constant_environment({2, 2, 2});
  const EnvironmentSampler sampler(environment);
  for (const float u : {0.0f, 0.4f, 0.999f}) {
    EXPECT_NEAR(sampler.sample(u, u).pdf, 1 / (4 * kPi), 1e-7);
  }
  EXPECT_GT(chi_square(sampler), 1e-4);
}

// A float running sum loses every texel of 0.01 behind a sun of 1e6; ours keeps them all.
TEST(Sampler, KeepsDimTexelsBehindASun) {
  Image map = map_of(64, 0.01f);
  std::fill_n(map.at(0, 0), 3, 1e6f);
  const Environment environment = environment_of(map);
  const EnvironmentSampler sampler(environment);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 128; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / 128, (y + 0.5) / 64);
      ASSERT_GT(sampler.pdf(to_float(d)), 0);
    }
  }
  float in_float = 1e6f;
  for (int i = 0; i < 1000; ++i) in_float += 0.01f;
  EXPECT_EQ(in_float, 1e6f);
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

}  // namespace
}  // namespace lightkiln
