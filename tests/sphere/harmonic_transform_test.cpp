#include "core/sphere/harmonic_transform.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "core/sphere/direction_map.h"
#include "core/sphere/fourier.h"
#include "core/sphere/quadrature.h"
#include "core/sphere/row_spectra.h"
#include "core/sphere/solid_angle.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

ShRgb project(const Image& image, int bands, double tolerance = 1e-12) {
  Progress progress;
  const std::vector<double> weights(static_cast<size_t>(bands), 1.0);
  const int points = row_gauss_points(image.height, weights, tolerance);
  return world_harmonics(project_latlong(image, bands, points, 1, progress), bands);
}

double worst_difference(const ShRgb& a, const ShRgb& b) {
  double worst = 0;
  for (size_t i = 0; i < a.coefficients.size(); ++i) {
    worst = std::max(worst, length(a.coefficients[i] - b.coefficients[i]));
  }
  return worst;
}

TEST(Fourier, EqualsTheDefinitionForAnyLength) {
  for (const int n : {1, 2, 3, 4, 5, 6, 7, 8, 10, 14, 15, 32, 45, 50, 60, 74, 90, 100}) {
    const Fourier fourier(n);
    std::vector<Complex4> data(static_cast<size_t>(n)), work;
    for (int j = 0; j < n; ++j) {
      for (int lane = 0; lane < kLanes; ++lane) {
        data[static_cast<size_t>(j)].re.set(lane, std::sin(1.0 + j * j + lane));
        data[static_cast<size_t>(j)].im.set(lane, std::cos(2.0 * j - lane));
      }
    }
    const auto input = data;
    fourier.forward(data.data(), work);
    for (int k = 0; k < n; ++k) {
      std::complex<double> sum;
      for (int j = 0; j < n; ++j) {
        const Complex4& x = input[static_cast<size_t>(j)];
        sum += std::complex<double>(x.re[1], x.im[1]) * std::polar(1.0, -2 * kPi * j * k / n);
      }
      EXPECT_NEAR(data[static_cast<size_t>(k)].re[1], sum.real(), 1e-11) << n;
      EXPECT_NEAR(data[static_cast<size_t>(k)].im[1], sum.imag(), 1e-11) << n;
    }
    fourier.inverse(data.data(), work);
    for (size_t j = 0; j < input.size(); ++j) {
      EXPECT_NEAR(data[j].re[3] / n, input[j].re[3], 1e-13);
    }
  }
}

// Which lengths go which way, so that the test above is known to have seen both.
TEST(Fourier, TakesProductsOfTwoThreeAndFiveAsTheyAre) {
  for (const int n : {1, 2, 3, 45, 1440, 6000}) EXPECT_TRUE(Fourier::transforms_directly(n)) << n;
  for (const int n : {7, 14, 74, 1442}) EXPECT_FALSE(Fourier::transforms_directly(n)) << n;
}

TEST(Quadrature, IsExactToDegreeTwiceThePointsLessOne) {
  for (const int n : {1, 2, 3, 8, 33}) {
    const GaussRule rule = gauss_legendre(n);
    for (int degree = 0; degree < 2 * n; ++degree) {
      double sum = 0;
      for (size_t i = 0; i < rule.nodes.size(); ++i) {
        sum += rule.weights[i] * std::pow(rule.nodes[i], degree);
      }
      EXPECT_NEAR(sum, degree % 2 == 0 ? 2.0 / (degree + 1) : 0.0, 1e-13);
    }
  }
}

TEST(HarmonicTransform, GivesAConstantOneCoefficient) {
  for (const int height : {1, 2, 7, 64}) {
    Image image(2 * height, height, 3);
    for (float& value : image.pixels) value = 1.5f;
    const ShRgb sh = project(image, 12);
    EXPECT_NEAR(sh.coefficients[0].x, 1.5 * 2 * std::sqrt(kPi), 1e-11) << height;
    for (size_t i = 1; i < sh.coefficients.size(); ++i) {
      EXPECT_NEAR(length(sh.coefficients[i]), 0, 1e-10) << height << " " << i;
    }
  }
}

// The twin's error falls as 1/cuts^2; Richardson's extrapolation removes it.
ShRgb extrapolated(const Image& sky, int bands, int cuts) {
  const ShRgb coarse = reference::project(sky, bands, cuts);
  const ShRgb fine = reference::project(sky, bands, 2 * cuts);
  ShRgb truth(bands);
  for (size_t i = 0; i < truth.coefficients.size(); ++i) {
    truth.coefficients[i] = (fine.coefficients[i] * 4 - coarse.coefficients[i]) / 3;
  }
  return truth;
}

// An asymmetric map against the plain sum, per band and order: a furnace sees no swapped or negated
// coefficient. Odd heights and widths of every kind.
TEST(HarmonicTransform, EqualsTheSumOverTexels) {
  for (const int height : {3, 8, 25, 37}) {
    const Image sky = reference::test_sky(height, 50.0);
    const ShRgb truth = extrapolated(sky, 7, 96 / height + 2);
    EXPECT_LT(worst_difference(project(sky, 7), truth), 2e-5 * length(truth.coefficients[0]))
        << height;
  }
}

// A map of one basis function at a time, over a mean that keeps it positive: every coefficient
// turns up where it belongs, with its sign, and nowhere else.
TEST(HarmonicTransform, FindsEachHarmonicWhereItBelongs) {
  constexpr int kBands = 5;
  std::vector<double> basis(25);
  for (size_t i = 1; i < 25; ++i) {
    Image map(128, 64, 3);
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) {
        sh_evaluate_basis(latlong_direction((x + 0.5) / 128, (y + 0.5) / 64), kBands, basis);
        for (int c = 0; c < 3; ++c) map.at(x, y)[c] = static_cast<float>(2 + (c + 1) * basis[i]);
      }
    }
    const ShRgb sh = project(map, kBands);
    for (size_t k = 1; k < 25; ++k) {
      for (int c = 0; c < 3; ++c) {
        // Texels are boxes: order 4 keeps sinc(4 pi / 128), 0.9984, of its length.
        EXPECT_NEAR(sh.coefficients[k][c] / (c + 1), k == i ? 1 : 0, 3e-3) << i << " " << k;
      }
    }
  }
}

TEST(HarmonicTransform, IsExactOverABoxWherePointsAreNot) {
  const Image sky = reference::test_sky(16, 1000.0);
  const ShRgb truth = extrapolated(sky, 6, 16);
  EXPECT_LT(worst_difference(project(sky, 6), truth), 1e-6 * length(truth.coefficients[0]));
  EXPECT_GT(worst_difference(reference::project(sky, 6, 1), truth),
            1e-4 * length(truth.coefficients[0]));  // texels as points: what the boxes cure
}

// One row of light at the pole is a cap: Z_0 = 2 sqrt(pi) sin^2(a/2),
// Z_l = sqrt(pi / (2l+1)) (P_{l-1}(cos a) - P_{l+1}(cos a)), about +Y.
TEST(HarmonicTransform, ProjectsACapInClosedForm) {
  Image image(32, 16, 3);
  for (int x = 0; x < 32; ++x) image.at(x, 0)[1] = 1;
  Progress progress;
  const std::vector<double> weights(40, 1.0);
  const LatlongSpectrum spectrum =
      project_latlong(image, 40, row_gauss_points(16, weights, 1e-13), 1, progress);
  const double c = std::cos(kPi / 16);
  std::vector<double> p = {1, c};
  for (int l = 2; l <= 41; ++l) {
    const size_t k = static_cast<size_t>(l);
    p.push_back(((2 * l - 1) * c * p[k - 1] - (l - 1) * p[k - 2]) / l);
  }
  const double s = std::sin(kPi / 32);
  EXPECT_NEAR(spectrum.coefficients[spectrum.offset(0, 0) + 1], 2 * std::sqrt(kPi) * s * s, 1e-14);
  for (int l = 1; l < 40; ++l) {
    const size_t k = static_cast<size_t>(l);
    EXPECT_NEAR(spectrum.coefficients[spectrum.offset(l, 0) + 1],
                std::sqrt(kPi / (2 * l + 1)) * (p[k - 1] - p[k + 1]), 1e-13);
    for (int m = 1; m <= l; ++m) {
      EXPECT_NEAR(spectrum.coefficients[spectrum.offset(l, m) + 1], 0, 1e-13);
    }
  }
}

// One small texel is a delta: L_lm = E y_lm(d) while l times its width is small.
TEST(HarmonicTransform, ProjectsOneHotTexelAsADelta) {
  Image image(1024, 512, 3);
  image.at(300, 140)[0] = 1e5f;
  const ShRgb sh = project(image, 5);
  const double energy = 1e5 * latlong_texel_solid_angle(140, 1024, 512);
  std::vector<double> basis(25);
  sh_evaluate_basis(latlong_direction(300.5 / 1024, 140.5 / 512), 5, basis);
  for (size_t i = 0; i < 25; ++i) {
    EXPECT_NEAR(sh.coefficients[i].x, energy * basis[i], 1e-4 * energy);
  }
}

// E7: Rotating the map about +Y by k texels must equal rotating the coefficients: the seam is
// nothing.
TEST(HarmonicTransform, TurnsWithTheMapAcrossTheSeam) {
  const Image sky = reference::test_sky(32, 300.0);
  Image turned(64, 32, 3);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) std::copy_n(sky.at((x + 13) % 64, y), 3, turned.at(x, y));
  }
  const ShRgb a = project(sky, 7), b = project(turned, 7);
  // Texel x of the turned map shows what texel x + 13 showed: light moves to greater longitudes.
  const auto worst_for = [&](double angle) {
    double worst = 0;
    for (int i = 0; i < 12; ++i) {
      const Vec3d d = cube_texel_direction(i % 6, i % 3, i % 2, 3);
      const Vec3d before{d.x * std::cos(angle) - d.z * std::sin(angle), d.y,
                         d.z * std::cos(angle) + d.x * std::sin(angle)};
      worst = std::max(worst, length(sh_evaluate(b, d) - sh_evaluate(a, before)));
    }
    return worst / length(a.coefficients[0]);
  };
  EXPECT_LE(worst_for(2 * kPi * 13 / 64), 1e-6);
  // Positive control: texels spread over width - 1 would tear at the seam.
  EXPECT_GT(worst_for(2 * kPi * 13 / 63), 1e-4);
}

TEST(HarmonicTransform, ComesBackOnRingsAndBetweenThem) {
  const Image sky = reference::test_sky(24, 30.0);
  Progress progress;
  constexpr int kBands = 21;
  const LatlongSpectrum spectrum = project_latlong(sky, kBands, 16, 1, progress);
  const ShRgb world = world_harmonics(spectrum, kBands);
  std::vector<double> factors;
  for (int l = 0; l < kBands; ++l) factors.push_back(std::exp(-0.02 * l * l));
  ShRgb smooth = world;
  for (int l = 0; l < kBands; ++l) {
    for (int m = -l; m <= l; ++m) {
      smooth.coefficients[sh_index(l, m)] *= factors[static_cast<size_t>(l)];
    }
  }
  const RingGrid grid = synthesise_rings(spectrum, factors, 64, 128, 1, progress);
  for (int face = 0; face < 6; ++face) {
    for (int i = 0; i < 25; ++i) {
      const Vec3d d = cube_texel_direction(face, i % 5, i / 5, 5);
      EXPECT_NEAR(length(grid.interpolate(d) - sh_evaluate(smooth, d)), 0, 2e-5);
    }
  }
  const Vec3d poles[] = {{0, 1, 0}, {0, -1, 0}, {1e-12, 1, 0}, {0, 0, -1}, {-1e-17, 0, -1}};
  for (const Vec3d& d : poles) {
    EXPECT_NEAR(length(grid.interpolate(d) - sh_evaluate(smooth, d)), 0, 2e-5);
  }
}

// Few bands are summed directly, many by fast transforms: the same integrals, in every order.
TEST(HarmonicTransform, SumsRowsDirectlyAndByTransformsAlike) {
  Progress progress;
  for (const int height : {2, 6, 50, 75}) {
    Image sky = reference::test_sky(height, 1e3);
    if (sky.width % 4 != 0) continue;
    const RowSpectra direct = row_spectra(sky, 40, 1, progress, RowMethod::direct);
    const RowSpectra fourier = row_spectra(sky, 40, 1, progress, RowMethod::fourier);
    ASSERT_EQ(direct.values.size(), fourier.values.size());
    for (size_t i = 0; i < direct.values.size(); ++i) {
      for (int lane = 0; lane < kLanes; ++lane) {
        ASSERT_NEAR(direct.values[i][lane], fourier.values[i][lane], 1e-9) << height << " " << i;
      }
    }
  }
}

TEST(HarmonicTransform, ComesBackFromTheWorldFrame) {
  Progress progress;
  const LatlongSpectrum spectrum = project_latlong(reference::test_sky(20, 50), 12, 4, 1, progress);
  const LatlongSpectrum again = latlong_spectrum(world_harmonics(spectrum, 12));
  for (size_t i = 0; i < spectrum.coefficients.size(); ++i) {
    EXPECT_NEAR(again.coefficients[i], spectrum.coefficients[i], 1e-12);
  }
}

TEST(HarmonicTransform, GivesTheSameBitsForAnyNumberOfThreads) {
  const Image sky = reference::test_sky(50, 1e4);
  Progress progress;
  const LatlongSpectrum one = project_latlong(sky, 60, 3, 1, progress);
  const LatlongSpectrum few = project_latlong(sky, 7, 3, 1, progress);
  for (const int threads : {2, 3, 8}) {
    EXPECT_EQ(one.coefficients, project_latlong(sky, 60, 3, threads, progress).coefficients);
    EXPECT_EQ(few.coefficients, project_latlong(sky, 7, 3, threads, progress).coefficients);
  }
}

// The bound against every row's own quadrature, for light at one place of it: what n points leave
// of y_lm sin(theta) over the row, by band, against forty.
TEST(RowBandError, HoldsForTheWorstPlaceOfAMap) {
  const GaussRule fine = gauss_legendre(40);
  for (const auto& [height, l] : {std::pair{512, 1},
                                  {512, 2},
                                  {1024, 2},
                                  {64, 8},
                                  {512, 64},
                                  {1024, 128},
                                  {256, 128},
                                  {512, 300}}) {
    for (int points = 1; points <= 4; ++points) {
      const GaussRule rule = gauss_legendre(points);
      const double step = kPi / height;
      const auto integral = [&](const GaussRule& r, int row, int m) {
        double sum = 0;
        for (size_t i = 0; i < r.nodes.size(); ++i) {
          const double theta = (row + 0.5 + 0.5 * r.nodes[i]) * step;
          sum += 0.5 * step * r.weights[i] * std::sin(theta) *
                 std::sph_legendre(static_cast<unsigned>(l), static_cast<unsigned>(m), theta);
        }
        return sum;
      };
      double worst = 0;
      for (const int row : {0, 1, 2, height / 8, height / 4, height / 2 - 1}) {
        const double omega = std::cos(row * step) - std::cos((row + 1) * step);
        double squares = 0;
        for (int m = 0; m <= l; ++m) {
          const double error = integral(rule, row, m) - integral(fine, row, m);
          squares += (m > 0 ? 2 : 1) * error * error;
        }
        worst = std::max(worst, std::sqrt(squares) / omega * std::sqrt(4 * kPi));
      }
      const double bound = row_band_error(points, l, height);
      EXPECT_LE(worst, bound + 1e-12) << height << " " << l << " " << points;
      if (bound < 1e-10) continue;  // rounding
      EXPECT_GE(worst, 0.1 * bound) << height << " " << l << " " << points;
    }
  }
}

}  // namespace
}  // namespace lightkiln
