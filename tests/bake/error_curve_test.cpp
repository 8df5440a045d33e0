#include "core/bake/error_curve.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

TEST(ErrorCurve, FollowsWhatWasSeenAndThenTheSlope) {
  const ErrorCurve curve{64, {0.4, 0.3, 0.2}, 0.75};
  EXPECT_EQ(curve.error(0), 0.4);
  EXPECT_EQ(curve.error(2), 0.2);
  EXPECT_NEAR(curve.error(4), 0.2 * std::exp2(-1.5), 1e-15);
  EXPECT_EQ(ErrorCurve{}.error(3), 0);
}

TEST(ErrorCurve, SlopesAreFittedAndKeptWithinReason) {
  std::vector<double> errors;
  for (int i = 0; i < 5; ++i) errors.push_back(0.5 * std::exp2(-0.75 * i));
  EXPECT_NEAR(fitted_slope(errors), 0.75, 1e-12);
  EXPECT_EQ(fitted_slope(std::vector<double>{1, 1, 1}), 0.5);
  EXPECT_EQ(fitted_slope(std::vector<double>{1, 0.1, 0.01}), 1.5);
  EXPECT_EQ(fitted_slope(std::vector<double>{1}, 0.75), 0.75);
  EXPECT_EQ(fitted_slope({}), 0.5);
}

TEST(ErrorCurve, RulesEndWhereTheirWideningAllows) {
  const ErrorCurve curve{64, {0.4, 0.2, 0.1, 0.05}, 1};
  const auto samples = [&](double target, uint64_t fewest, uint64_t most, double wide = 1) {
    return stop_of(
               curve, [=](int) { return wide; }, target, fewest, most)
        .samples;
  };
  EXPECT_EQ(samples(0.5, 64, 1024), 64u);
  EXPECT_EQ(samples(0.1, 64, 1024), 256u);
  EXPECT_EQ(samples(0.1, 64, 1024, 1.5), 512u);
  EXPECT_EQ(samples(0.1, 512, 1024), 512u);
  EXPECT_EQ(samples(0.001, 64, 1024), 1024u);
  // Looks are counted from the fewest samples on.
  const auto third = [](int look) { return look < 3 ? 100.0 : 1.0; };
  EXPECT_EQ(stop_of(curve, third, 1, 128, 1 << 20).samples, 512u);
  const Stop beyond = stop_of(curve, nullptr, 0.02, 64, 1 << 20);
  EXPECT_EQ(beyond.samples, 2048u);
  EXPECT_TRUE(beyond.extrapolated);
  EXPECT_FALSE(stop_of(curve, nullptr, 0.05, 64, 1 << 20).extrapolated);
}

}  // namespace
}  // namespace lightkiln
