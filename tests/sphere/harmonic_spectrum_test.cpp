#include "core/sphere/harmonic_spectrum.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/harmonic_transform.h"
#include "core/sphere/zh3.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

Vec3d random_direction(uint64_t key, uint32_t index) {
  const Point2 p = sobol2(key, index);
  const double z = 1 - 2.0 * p.x, r = std::sqrt(1 - z * z), phi = 2 * kPi * p.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

std::vector<Vec3d> energies(const ShRgb& sh) {
  std::vector<Vec3d> energy(static_cast<size_t>(sh.bands));
  for (int l = 0; l < sh.bands; ++l) {
    for (int m = -l; m <= l; ++m) {
      const Vec3d& c = sh.coefficients[sh_index(l, m)];
      energy[static_cast<size_t>(l)] += c * c;
    }
  }
  return energy;
}

ShRgb project(const Image& map, int bands) {
  Progress progress;
  return world_harmonics(project_latlong(map, bands, 6, 1, progress), bands);
}

// L = 1 + a.w: band 1 holds |a|^2 4 pi / 3, and nothing is left after two bands.
TEST(HarmonicSpectrum, OfALinearSkyIsItsClosedForm) {
  const Vec3d a{0.3, -0.5, 0.2};
  const double linear = dot(a, a) * 4 * kPi / 3;
  const Vec3d white{1, 1, 1};
  const Vec3d energy[2] = {white * (4 * kPi), white * linear};
  const ShSpectrum spectrum = make_spectrum(energy, white * (4 * kPi + linear), white, 2);
  EXPECT_NEAR(spectrum.rows[0].radiance_rms, std::sqrt(dot(a, a) / 3), 1e-12);
  EXPECT_NEAR(spectrum.rows[0].irradiance_rms, 2.0 / 3 * std::sqrt(dot(a, a) / 3), 1e-12);
  // The worst direction is a itself, and the bound is reached: (2/3) |a|.
  EXPECT_NEAR(spectrum.rows[0].irradiance_max, 2.0 / 3 * length(a), 1e-7);
  EXPECT_NEAR(spectrum.rows[1].radiance_rms, 0, 1e-7);
  EXPECT_EQ(advise_bands(spectrum, 0.1).radiance_bands, 2);
  EXPECT_EQ(advise_bands(spectrum, 0.3).irradiance_bands, 1);
}

// The hemisphere sky: irradiance is exact after two bands although radiance never is.
TEST(HarmonicSpectrum, KnowsThatAHemisphereNeedsTwoBandsForIrradiance) {
  Image sky(128, 64, 3);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 3 * 128; ++x) sky.at(0, y)[x] = 1;
  }
  Progress progress;
  const Vec3d total = latlong_energy(sky, 1, progress);
  EXPECT_NEAR(total.x, 2 * kPi, 1e-12);
  const auto energy = energies(project(sky, 40));
  const ShSpectrum spectrum = make_spectrum(energy, total, {0.5, 0.5, 0.5}, 40);
  EXPECT_EQ(advise_bands(spectrum, 0.001).radiance_bands, 0);  // more than forty
  EXPECT_EQ(advise_bands(spectrum, 0.001).irradiance_bands, 2);
  EXPECT_GT(spectrum.rows[1].radiance_rms, 0.3);
  EXPECT_LT(spectrum.rows[1].irradiance_rms, 1e-4);
}

// Against the map itself: the error after n bands by summing squared differences over directions.
TEST(HarmonicSpectrum, StatesTheErrorThatIsMeasured) {
  const Image sky = reference::test_sky(48, 60.0);
  Progress progress;
  const ShRgb sh = project(sky, 33);
  const Vec3d mean = sh.coefficients[0] / (2 * std::sqrt(kPi));
  const ShSpectrum spectrum =
      make_spectrum(energies(sh), latlong_energy(sky, 1, progress), mean, 33);
  for (const int bands : {1, 2, 3, 5}) {
    ShRgb few(bands);
    std::copy_n(sh.coefficients.begin(), few.coefficients.size(), few.coefficients.begin());
    Vec3d square;
    double worst = 0;
    constexpr uint32_t kCount = 4096;
    for (uint32_t i = 0; i < kCount; ++i) {
      const Vec3d n = random_direction(4, i);
      const Vec3d difference = sh_irradiance(few, n) - sh_irradiance(sh, n);
      square += difference * difference / kCount;
      worst =
          std::max({worst, std::abs(difference.x), std::abs(difference.y), std::abs(difference.z)});
    }
    const double unit = kPi * luminance(mean);
    const double rms = std::sqrt(std::max({square.x, square.y, square.z})) / unit;
    const BandRow& row = spectrum.rows[static_cast<size_t>(bands - 1)];
    EXPECT_NEAR(row.irradiance_rms, rms, 0.02 * rms + 1e-5) << bands;
    EXPECT_GE(row.irradiance_max, worst / unit - 1e-9) << bands;
  }
  // Errors fall, and the recommendation is the first row that meets the order.
  for (size_t i = 1; i < spectrum.rows.size(); ++i) {
    EXPECT_LE(spectrum.rows[i].radiance_rms, spectrum.rows[i - 1].radiance_rms);
    EXPECT_LE(spectrum.rows[i].irradiance_rms, spectrum.rows[i - 1].irradiance_rms);
  }
  const int n = advise_bands(spectrum, 0.01).irradiance_bands;
  ASSERT_GE(n, 2);
  EXPECT_LE(spectrum.rows[static_cast<size_t>(n - 1)].irradiance_rms, 0.01);
  EXPECT_GT(spectrum.rows[static_cast<size_t>(n - 2)].irradiance_rms, 0.01);
}

// Under a small sun the energy beyond the known bands is large: the more bands are known, the
// closer the bound is to the error, and it never falls below it.
TEST(HarmonicSpectrum, BoundsATailTheBetterTheMoreIsKnown) {
  const Image sky = reference::test_sky(64, 1e5);
  Progress progress;
  const Vec3d total = latlong_energy(sky, 1, progress);
  const auto energy = energies(project(sky, 129));
  const Vec3d mean{1, 1, 1};
  const auto rms = [&](size_t known) {
    return make_spectrum(std::span(energy).first(known), total, mean, 9).rows[8].irradiance_rms;
  };
  const double all = rms(129);
  EXPECT_GT(rms(9), 1.5 * all);
  EXPECT_GE(rms(33), all);
  EXPECT_GE(rms(65), all);
  EXPECT_LT(rms(65), rms(33));
}

TEST(HarmonicSpectrum, OfBlackIsZero) {
  const std::vector<Vec3d> energy(5);
  const ShSpectrum spectrum = make_spectrum(energy, {}, {}, 5);
  EXPECT_EQ(advise_bands(spectrum, 0.01).radiance_bands, 1);
  EXPECT_EQ(advise_bands(spectrum, 0.01).irradiance_bands, 1);
  EXPECT_EQ(spectrum.rows[0].radiance_rms, 0);
}

// The coefficients that Ramamoorthi and Hanrahan print (2001) for two probes: their polynomial is
// our irradiance, and neither probe is served to 5 % by two bands.
TEST(HarmonicSpectrum, ReadsPublishedProbes) {
  const double grace[9][3] = {{0.79, 0.44, 0.54},    {0.39, 0.35, 0.60},    {-0.34, -0.18, -0.27},
                              {-0.29, -0.06, 0.01},  {-0.11, -0.05, -0.12}, {-0.26, -0.22, -0.47},
                              {-0.16, -0.09, -0.15}, {0.56, 0.21, 0.14},    {0.21, -0.05, -0.30}};
  const double eucalyptus[9][3] = {
      {0.38, 0.43, 0.45},    {0.29, 0.36, 0.41},    {0.04, 0.03, 0.01},
      {-0.10, -0.10, -0.09}, {-0.06, -0.06, -0.04}, {0.01, -0.01, -0.05},
      {-0.09, -0.13, -0.15}, {-0.06, -0.05, -0.04}, {0.02, 0.00, -0.05}};
  for (const auto* table : {grace, eucalyptus}) {
    ShRgb sh(3);
    for (size_t i = 0; i < 9; ++i) sh.coefficients[i] = {table[i][0], table[i][1], table[i][2]};
    const auto energy = energies(sh);
    Vec3d total;
    for (const Vec3d& e : energy) total += e;
    const ShSpectrum spectrum =
        make_spectrum(energy, total, sh.coefficients[0] / (2 * std::sqrt(kPi)), 3);
    const Zh3 zh3 = make_zh3(sh);
    EXPECT_LE(zh3.fitted_error, zh3.linear_error);
    EXPECT_EQ(advise_bands(spectrum, 0.05).irradiance_bands, 3);
    // The printed irradiance polynomial at the pole of each axis.
    for (const Vec3d& n : {Vec3d{1, 0, 0}, Vec3d{0, -1, 0}, Vec3d{0, 0, 1}}) {
      const auto L = [&](int l, int m) { return sh.coefficients[sh_index(l, m)].x; };
      const double printed = 0.429043 * L(2, 2) * (n.x * n.x - n.y * n.y) +
                             0.743125 * L(2, 0) * n.z * n.z + 0.886227 * L(0, 0) -
                             0.247708 * L(2, 0) +
                             2 * 0.511664 * (L(1, 1) * n.x + L(1, -1) * n.y + L(1, 0) * n.z);
      EXPECT_NEAR(sh_irradiance(sh, n).x, printed, 2e-6);
    }
  }
}

// A zonal sky: the fit is exact.
TEST(Zh3, FitsAZonalSkyExactly) {
  const Vec3d axis = normalize(Vec3d{0.2, 0.9, -0.4});
  std::vector<double> basis(9);
  sh_evaluate_basis(axis, 3, basis);
  ShRgb sky(3);
  for (size_t i = 0; i < 9; ++i) sky.coefficients[i] = Vec3d{1, 2, 0.5} * basis[i];
  sky.coefficients[0] += Vec3d{1, 1, 1};
  const Zh3 zh3 = make_zh3(sky);
  EXPECT_LT(length(zh3.axis - axis), 1e-12);
  EXPECT_LT(zh3.fitted_error, 1e-12);
  EXPECT_GT(zh3.linear_error, 0.05);
  for (uint32_t i = 0; i < 16; ++i) {
    const Vec3d n = random_direction(9, i);
    EXPECT_LT(length(zh3_irradiance(zh3, zh3.fitted, n) - sh_irradiance(sky, n)), 1e-12);
  }
}

// The curve fit of the paper: a linear band as long as the mean's gives 0.08 + 0.6 of it.
TEST(Zh3, HallucinatesByThePapersCurve) {
  ShRgb sky(2);
  sky.coefficients = {{1, 2, 0}, {0, 0, 0}, {0, 0, 0}, {0.5, 2, 0}};
  const Zh3 zh3 = make_zh3(sky);
  EXPECT_EQ(zh3.axis, (Vec3d{1, 0, 0}));
  EXPECT_NEAR(zh3.hallucinated.x, 0.5 * (0.08 + 0.3), 1e-15);
  EXPECT_NEAR(zh3.hallucinated.y, 2 * 0.68, 1e-15);
  EXPECT_EQ(zh3.hallucinated.z, 0);
}

// On a sky with a sun the guess must come closer than nothing, and the fit closer than the guess.
TEST(Zh3, FittedBeatsHallucinatedBeatsLinear) {
  const ShRgb sky = project(reference::test_sky(48, 400.0), 3);
  const Zh3 zh3 = make_zh3(sky);
  EXPECT_LT(zh3.fitted_error, zh3.hallucinated_error);
  EXPECT_LT(zh3.hallucinated_error, zh3.linear_error);
  // The stated error is the measured one.
  Vec3d square;
  constexpr uint32_t kCount = 4096;
  for (uint32_t i = 0; i < kCount; ++i) {
    const Vec3d n = random_direction(10, i);
    const Vec3d difference = zh3_irradiance(zh3, zh3.fitted, n) - sh_irradiance(sky, n);
    square += difference * difference / kCount;
  }
  double worst = 0;
  for (int c = 0; c < 3; ++c) {
    worst = std::max(worst, std::sqrt(square[c]) / (std::sqrt(kPi) / 2 * sky.coefficients[0][c]));
  }
  EXPECT_NEAR(zh3.fitted_error, worst, 0.01 * worst);
}

TEST(Zh3, OfAConstantOrBlackSkyIsLinear) {
  ShRgb white(1);
  white.coefficients[0] = {1, 1, 1};
  const Zh3 zh3 = make_zh3(white);
  EXPECT_EQ(zh3.fitted, Vec3d{});
  EXPECT_EQ(zh3.hallucinated, Vec3d{});
  EXPECT_EQ(make_zh3(ShRgb(1)).linear_error, 0);
}

}  // namespace
}  // namespace lightkiln
