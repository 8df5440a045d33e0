// Energy compensation and sheen's albedo; the plain table is tested with the levels.

#include "core/environment/dfg.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/environment/charlie_albedo.h"
#include "core/sphere/quadrature.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

// X3: A white surface under white light, F0 = 1: the twin's single scattering, an independent sum
// over half vectors, times the compensation that a shader takes from the table, is 1.
TEST(Dfg, CompensatesAFurnaceToOne) {
  Progress progress;
  const int size = 32;
  const Image table = dfg_table(size, {true, false}, 1, progress);
  for (const int y : {5, 15, 27, 31}) {
    for (const int x : {3, 15, 31}) {
      const double roughness = (y + 0.5) / size, cosine = (x + 0.5) / size;
      const reference::Dfg slow = reference::dfg(roughness * roughness, cosine, 1000);
      const double single = slow.scale + slow.bias;
      const double white = double(table.at(x, y)[1]);
      EXPECT_NEAR(single * (1 + 1.0 * (1 / white - 1)), 1, 2e-3) << roughness << " " << cosine;
      // Filament's reading of the two channels is the same surface.
      const double f0 = 0.3, bias = double(table.at(x, y)[0]);
      const DfgValue value = ggx_dfg(roughness * roughness, cosine);
      EXPECT_NEAR((f0 * (white - bias) + bias) * (1 + f0 * (1 / white - 1)),
                  compensated_reflectance(value, f0), 1e-6);
    }
  }
  // Positive control: uncompensated, a rough one loses more than half.
  EXPECT_LT(reference::dfg(1, 0.9, 300).scale + reference::dfg(1, 0.9, 300).bias, 0.5);
  EXPECT_NEAR(compensated_reflectance(ggx_dfg(1, 0.5), 1), 1, 1e-12);
}

// The plain double sum over directions l, from the vectors themselves.
double slow_albedo(double alpha, double cosine, int steps) {
  const Vec3d v{std::sqrt(1 - cosine * cosine), 0, cosine};
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double t = (i + 0.5) / steps, c = t * t;  // more of them at the horizon
    for (int j = 0; j < steps; ++j) {
      const double phi = kPi * (j + 0.5) / steps;
      const double s = std::sqrt(1 - c * c);
      const Vec3d l{s * std::cos(phi), s * std::sin(phi), c};
      const Vec3d h = normalize(l + v);
      const double d = (2 + 1 / alpha) * std::pow(std::hypot(h.x, h.y), 1 / alpha) / (2 * kPi);
      sum += 2 * t * d * c / (4 * (c + cosine - c * cosine));
    }
  }
  return sum * 2 * kPi / (double(steps) * steps);
}

TEST(CharlieAlbedo, EqualsAPlainSum) {
  for (const double roughness : {0.1, 0.3, 0.7, 1.0}) {
    for (const double cosine : {0.02, 0.2, 0.6, 0.98}) {
      const double alpha = roughness * roughness, slow = slow_albedo(alpha, cosine, 700);
      EXPECT_NEAR(charlie_albedo(alpha, cosine), slow, 2e-4 * std::max(1.0, slow))
          << roughness << " " << cosine;
    }
  }
}

// Every rule, over roughness and cosine down to what a table of 1024 entries a side asks for, is
// within its bound, and none states ten times what is seen. The grid's steps do not divide those
// that bounds were found on.
TEST(CharlieAlbedo, StaysWithinTheBoundOfEachRule) {
  constexpr int kSteps = 23;
  const CharlieIntegral finest(160);
  std::vector<double> truth;
  const auto value = [](int i) { return std::pow(2048, -double(i) / kSteps); };
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) truth.push_back(finest.at(value(i) * value(i), value(j)));
  }
  for (const CharlieRule& rule : charlie_rules()) {
    const CharlieIntegral integral(rule.points);
    double worst = 0;
    for (size_t k = 0; k < truth.size(); ++k) {
      const double r = value(static_cast<int>(k) / (kSteps + 1));
      const double found = integral.at(r * r, value(static_cast<int>(k) % (kSteps + 1)));
      ASSERT_TRUE(std::isfinite(found) && found >= 0);
      worst = std::max(worst, std::abs(found - truth[k]) / std::max(1.0, truth[k]));
    }
    EXPECT_LE(worst, rule.error_bound) << rule.points;
    EXPECT_GE(worst, 0.1 * rule.error_bound) << rule.points;
  }
}

TEST(Dfg, StaysWithinTheBoundOfEachRule) {
  constexpr int kSteps = 27;
  const DfgIntegral finest(80, 160);
  std::vector<DfgValue> truth;
  const auto alpha = [](int i) { return std::pow(1e-7, double(i) / kSteps); };
  const auto cosine = [](int j) { return std::pow(2048, -double(j) / kSteps); };
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) truth.push_back(finest.at(alpha(i), cosine(j)));
  }
  for (const DfgRule& rule : dfg_rules()) {
    const DfgIntegral integral(rule.azimuths, rule.radii);
    double worst = 0;
    for (size_t k = 0; k < truth.size(); ++k) {
      const DfgValue found = integral.at(alpha(static_cast<int>(k) / (kSteps + 1)),
                                         cosine(static_cast<int>(k) % (kSteps + 1)));
      ASSERT_TRUE(std::isfinite(found.scale) && found.scale >= 0 && found.bias >= 0);
      worst = std::max(
          {worst, std::abs(found.scale - truth[k].scale), std::abs(found.bias - truth[k].bias)});
    }
    EXPECT_LE(worst, rule.error_bound) << rule.points();
    EXPECT_GE(worst, 0.1 * rule.error_bound) << rule.points();
  }
}

// An order picks the cheapest rule that keeps it, and the table is then as exact as stated.
TEST(Dfg, PicksItsRuleFromTheOrder) {
  int last = 0, last_sheen = 0;
  for (const double error : {0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
    EXPECT_LE(dfg_rule(error).error_bound, error);
    EXPECT_LE(charlie_rule(error).error_bound, error);
    EXPECT_GE(dfg_rule(error).points(), last);
    EXPECT_GE(charlie_rule(error).points, last_sheen);
    last = dfg_rule(error).points();
    last_sheen = charlie_rule(error).points;
  }
  EXPECT_GT(last, 10 * dfg_rule(0.1).points());
  Progress progress;
  const int size = 32;
  const DfgIntegral finest(60, 120);
  double worst[2] = {0, 0};
  const double orders[2] = {1e-2, 1e-5};
  for (const int k : {0, 1}) {
    const DfgTableOptions options{false, true, orders[k]};
    EXPECT_LE(dfg_table_bound(options), orders[k]);
    const Image table = dfg_table(size, options, 1, progress);
    for (int y = 0; y < size; y += 3) {
      for (int x = 0; x < size; x += 3) {
        const double roughness = (y + 0.5) / size, cosine = (x + 0.5) / size;
        const DfgValue truth = finest.at(roughness * roughness, cosine);
        worst[k] = std::max({worst[k], std::abs(double(table.at(x, y)[0]) - truth.scale),
                             std::abs(double(table.at(x, y)[1]) - truth.bias)});
      }
    }
    EXPECT_LE(worst[k], dfg_table_bound(options));
  }
  EXPECT_GT(worst[0], 30 * worst[1]);
}

TEST(Dfg, LaysItsChannelsOutAsOrdered) {
  Progress progress;
  const Image plain = dfg_table(8, {false, false}, 1, progress);
  const Image both = dfg_table(8, {true, true}, 1, progress);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const float* p = plain.at(x, y);
      const float* b = both.at(x, y);
      EXPECT_EQ(p[2], 0);
      EXPECT_EQ(b[0], p[1]);
      EXPECT_NEAR(b[1], p[0] + p[1], 2e-7);
      const double roughness = (y + 0.5) / 8;
      EXPECT_NEAR(b[2], charlie_albedo(roughness * roughness, (x + 0.5) / 8), 5e-5);
    }
  }
}

}  // namespace
}  // namespace lightkiln
