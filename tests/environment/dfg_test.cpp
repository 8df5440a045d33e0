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

TEST(CharlieAlbedo, StaysWithinItsBound) {
  for (int i = 0; i <= 9; ++i) {
    for (int j = 0; j <= 9; ++j) {
      const double roughness = std::pow(256, -i / 9.0), cosine = std::pow(256, -j / 9.0);
      const double fast = charlie_albedo(roughness * roughness, cosine);
      const double fine = charlie_albedo(roughness * roughness, cosine, 6);
      EXPECT_LE(std::abs(fast - fine), kCharlieAlbedoErrorBound * std::max(1.0, fine))
          << roughness << " " << cosine;
      EXPECT_TRUE(std::isfinite(fast) && fast >= 0);
    }
  }
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
      EXPECT_EQ(b[2], static_cast<float>(charlie_albedo(roughness * roughness, (x + 0.5) / 8)));
    }
  }
}

}  // namespace
}  // namespace lightkiln
