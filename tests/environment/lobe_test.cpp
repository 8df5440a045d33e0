#include "core/environment/lobe.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/math.h"
#include "core/environment/charlie_lobe.h"
#include "core/environment/ggx_lobe.h"
#include "core/environment/roughness_scale.h"
#include "core/environment/vector_math.h"

namespace lightkiln {
namespace {

// E[c^k] under (p+1)(p+2) c (1-c)^p is (k+1)! (p+2)! / (p+k+2)!, so that h_1 = 2 / (p + 3) and
// h_2 = (18 / ((p+3) (p+4)) - 1) / 2, p = 1 / (2 alpha).
TEST(CharlieLobe, HasItsClosedFormResponses) {
  for (const double alpha : {0.01, 0.0625, 0.3, 1.0}) {
    const double p = 0.5 / alpha;
    const std::vector<double> responses = band_responses(CharlieLobe(alpha), 700);
    EXPECT_NEAR(responses[0], 1, 1e-10) << alpha;
    EXPECT_NEAR(responses[1], 2 / (p + 3), 1e-10) << alpha;
    EXPECT_NEAR(responses[2], (18 / ((p + 3) * (p + 4)) - 1) / 2, 1e-10) << alpha;
  }
}

// Written from the half vector: D(h) n.l with h between n and l.
TEST(CharlieLobe, IsTheDistributionOfHalfVectors) {
  for (const double alpha : {0.01, 0.25, 1.0}) {
    const auto plain = [&](double t) { return std::pow(std::sin(t / 2), 1 / alpha) * std::cos(t); };
    const CharlieLobe lobe(alpha);
    for (const double t : {0.4, 0.9, 1.3, 1.5}) {
      const double ratio = plain(t) / plain(1.2);
      EXPECT_NEAR(lobe.at_angle(t) / lobe.at_angle(1.2), ratio, 1e-9 * ratio);
      EXPECT_NEAR(lobe(std::cos(t)), lobe.at_angle(t), 1e-12 * lobe.at_angle(t));
    }
    EXPECT_EQ(lobe.at_angle(1.6), 0);
    EXPECT_EQ(lobe(-0.1), 0);
  }
}

// A ring about the horizon, not a peak about the normal: what tells it from GGX.
TEST(CharlieLobe, IsARing) {
  EXPECT_GT(CharlieLobe(0.05).at_angle(1.45), 1e3 * CharlieLobe(0.05).at_angle(0.8));
  EXPECT_LT(GgxLobe(0.05).at_angle(1.45), GgxLobe(0.05).at_angle(0.8));
}

// Core and halo are the lobe, and the halo alone has no band beyond exp(-l^2 / split).
TEST(GgxHalo, LosesItsCoreAndItsHighBands) {
  const double split = 1e4;
  for (const double alpha : {1e-6, 0.0025, 0.01}) {
    const GgxLobe lobe(alpha);
    const GgxHalo halo(alpha, split);
    for (const double t : {1e-4, 1e-3, 0.01, 0.05, 0.3, 1.2}) {
      const double s = std::sin(t / 2);
      const double z = split * (lobe.narrow() + lobe.broad() * 2 * s * s);
      const double core = lobe.at_angle(t) * (1 + z) * std::exp(-z);
      EXPECT_NEAR((core + halo.at_angle(t)) / lobe.at_angle(t), 1, 1e-12) << alpha << " " << t;
    }
    const std::vector<double> responses = band_responses(halo, 401);
    EXPECT_LT(std::abs(responses[400]), 2e-7) << alpha;
    // The lobe itself has them all: that is why it is split.
    EXPECT_GT(band_responses(lobe, 401)[400], 1e-6) << alpha;
  }
}

TEST(RoughnessScale, InvertsTheCurvesOfEngines) {
  const auto curve = [](RoughnessScale scale, double r) {
    if (scale == RoughnessScale::filament) return r * (2 - r);
    if (scale == RoughnessScale::unity) return r * (1.7 - 0.7 * r);
    return r;
  };
  for (const auto scale :
       {RoughnessScale::linear, RoughnessScale::filament, RoughnessScale::unity}) {
    for (const int levels : {2, 5, 9}) {
      const std::vector<double> roughness = level_roughness(scale, levels);
      ASSERT_EQ(roughness.size(), static_cast<size_t>(levels));
      for (int level = 0; level < levels; ++level) {
        EXPECT_NEAR(curve(scale, roughness[static_cast<size_t>(level)]),
                    double(level) / (levels - 1), 1e-12);
      }
      EXPECT_EQ(roughness.front(), 0);
      EXPECT_NEAR(roughness.back(), 1, 1e-12);
    }
  }
}

TEST(VectorMath, ComputesExponentialsAndPowers) {
  for (double z = 0; z < 64; z += 0.37) {
    EXPECT_NEAR(exp_minus(z) / std::exp(-z), 1, z < 24 ? 1e-9 : 5e-6);
  }
  for (const double power : {0.5, 3.0, 700.0}) {
    for (double base = 1e-4; base <= 1; base *= 1.3) {
      EXPECT_NEAR(power_below_one(base, power), std::pow(base, power), 1e-8);
    }
  }
}

}  // namespace
}  // namespace lightkiln
