// Tags beside tests are explained in tests/support/hard_cases.h.

#include "core/base/random.h"

#include <array>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/math.h"
#include "core/base/statistics.h"

namespace lightkiln {
namespace {

std::array<float, 4> coordinates(const Point4& p) {
  return {p.x, p.y, p.z, p.w};
}

TEST(Random, UnitFloatsNeverReachOne) {  // S1
  EXPECT_LT(to_unit_float(0xffffffffu), 1.0f);
  EXPECT_EQ(to_unit_float(0), 0.0f);
  // Positive control: the plain product rounds to one.
  EXPECT_EQ(static_cast<float>(0xffffffffu) * 0x1p-32f, 1.0f);
}

TEST(Random, BasisIsOrthonormalDownToTheSouthPole) {  // S3
  for (double below = 1; below > 1e-9; below *= 0.5) {
    const double theta = kPi - below;
    const Vec3 n = to_float({std::sin(theta) * 0.6, std::sin(theta) * 0.8, std::cos(theta)});
    const Basis<float> b = make_basis(n);
    EXPECT_NEAR(length(b.tangent), 1, 1e-6);
    EXPECT_NEAR(length(b.bitangent), 1, 1e-6);
    EXPECT_NEAR(dot(b.tangent, b.bitangent), 0, 1e-6);
    EXPECT_NEAR(dot(b.tangent, n), 0, 1e-6);
    EXPECT_NEAR(dot(cross(b.tangent, b.bitangent), n), 1, 1e-6);
  }
}

// Integral of a smooth function by the first n points; the truth is 1.
double smooth_mean(uint64_t key, uint32_t n, uint32_t skip = 0) {
  double sum = 0;
  for (uint32_t i = skip; i < n + skip; ++i) {
    const Point2 p = sobol2(key, i);
    sum += 0.25 * kPi * kPi * std::sin(kPi * static_cast<double>(p.x)) *
           std::sin(kPi * static_cast<double>(p.y));
  }
  return sum / n;
}

double smooth_rmse(uint32_t n, uint32_t skip = 0) {
  double sum = 0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    const double error = smooth_mean(hash64(static_cast<uint64_t>(run)), n, skip) - 1;
    sum += error * error / kRuns;
  }
  return std::sqrt(sum);
}

TEST(Random, PowersOfTwoBeatTheirNeighbours) {  // S4
  EXPECT_LT(smooth_rmse(512), 0.5 * smooth_rmse(511));
  EXPECT_LT(smooth_rmse(256), 0.5 * smooth_rmse(300));
}

TEST(Random, SmoothIntegrandsConvergeFasterThanAnySlopeOfPlainSampling) {
  const double slope = std::log2(smooth_rmse(1024) / smooth_rmse(64)) / 4;
  EXPECT_LE(slope, -1.2);
}

// Number of elementary intervals 2^-a x 2^-(m-a) that do not hold exactly one of 2^m points.
int uneven_intervals(uint64_t key, int first, int second, int m) {
  int uneven = 0;
  const uint32_t n = 1u << m;
  for (int a = 0; a <= m; ++a) {
    std::vector<int> count(n, 0);
    for (uint32_t i = 0; i < n; ++i) {
      const auto p = coordinates(sobol4(key, i));
      const auto column = static_cast<uint32_t>(std::ldexp(p[static_cast<size_t>(first)], a));
      const auto row = static_cast<uint32_t>(std::ldexp(p[static_cast<size_t>(second)], m - a));
      ++count[column << (m - a) | row];
    }
    for (const int c : count) uneven += c != 1;
  }
  return uneven;
}

TEST(Random, FirstTwoDimensionsFillEveryElementaryInterval) {  // S5
  for (uint64_t key = 0; key < 5; ++key)
    for (const int m : {1, 4, 7, 10}) EXPECT_EQ(uneven_intervals(hash64(key), 0, 1, m), 0) << m;
}

TEST(Random, EveryDimensionIsStratifiedAlone) {  // S5
  for (size_t d = 0; d < 4; ++d) {
    std::set<uint32_t> strata;
    for (uint32_t i = 0; i < 1024; ++i)
      strata.insert(static_cast<uint32_t>(coordinates(sobol4(77, i))[d] * 1024));
    EXPECT_EQ(strata.size(), 1024u) << d;
  }
}

TEST(Random, DimensionsOfAllSetsAreUncorrelatedAndUniform) {  // S5
  constexpr uint32_t n = 4096;
  constexpr size_t kSets = 4;
  std::vector<std::vector<double>> columns(4 * kSets);
  for (size_t set = 0; set < kSets; ++set)
    for (uint32_t i = 0; i < n; ++i) {
      const auto p = coordinates(sobol4(hash_combine(9, set), i));
      for (size_t d = 0; d < 4; ++d)
        columns[4 * set + d].push_back(static_cast<double>(p[d]) - 0.5);
    }
  for (size_t a = 0; a < columns.size(); ++a) {
    // Chi-squared over 64 bins of the first 512 points; stratified points fall far below the 1e-4
    // quantile of plain ones (63 degrees of freedom: 114).
    std::array<int, 64> bins{};
    for (size_t i = 0; i < 512; ++i) ++bins[static_cast<size_t>((columns[a][i] + 0.5) * 64)];
    double chi2 = 0;
    for (const int bin : bins) chi2 += (bin - 8.0) * (bin - 8.0) / 8;
    EXPECT_LT(chi2, 114);
    for (size_t b = a + 1; b < columns.size(); ++b) {
      double sum = 0;
      for (uint32_t i = 0; i < n; ++i) sum += columns[a][i] * columns[b][i];
      EXPECT_LE(std::abs(12 * sum / n), 4 / std::sqrt(n)) << a << " " << b;
    }
  }
}

TEST(Random, KeysGiveIndependentPointSets) {  // S6
  RunningMoments products;
  double square = 0;
  for (uint64_t pair = 0; pair < 1000; ++pair) {
    const double a = smooth_mean(hash_combine(1, pair), 16) - 1;
    const double b = smooth_mean(hash_combine(1, pair + 1), 16) - 1;
    products.add(a * b);
    square += a * a / 1000;
  }
  EXPECT_LE(std::abs(products.mean / square), 0.13);
}

TEST(Random, TwoDimensionsAreTheFirstOfFour) {
  for (uint32_t i = 0; i < 100; ++i) {
    const Point4 four = sobol4(123456789, i * 977);
    const Point2 two = sobol2(123456789, i * 977);
    EXPECT_EQ(four.x, two.x);
    EXPECT_EQ(four.y, two.y);
  }
}

TEST(Random, PointsAreFixedForEver) {
  // A change of these values changes every result and needs a new engine version.
  EXPECT_EQ(hash64(0), 0xe220a8397b1dcdafu);
  const SobolBits4 p = sobol4_bits(42, 7);
  const SobolBits4 q = sobol4_bits(42, 7);
  EXPECT_EQ(p.x, q.x);
  EXPECT_EQ(p.w, q.w);
  EXPECT_NE(sobol4_bits(42, 8).x, p.x);
}

}  // namespace
}  // namespace lightkiln
