#include "core/bake/accuracy.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

Round round_of(uint64_t samples, uint64_t elements, double rms, double wall_s) {
  Round round;
  round.samples = samples;
  round.elements = elements;
  round.rays = samples * elements;
  round.wall_s = wall_s;
  round.error_sum_sq = rms * rms * static_cast<double>(elements);
  round.error_max = 2 * rms;
  return round;
}

TEST(Accuracy, ReachedErrorsAreQuotedAsMeasured) {
  const std::vector<Round> rounds = {round_of(256, 10, 0.08, 1), round_of(512, 10, 0.02, 1)};
  const std::vector<Price> prices = price_errors(rounds, 10);
  ASSERT_EQ(prices.size(), 5u);
  EXPECT_FALSE(prices[0].extrapolated);
  EXPECT_EQ(prices[0].samples, 256u);
  EXPECT_EQ(prices[0].seconds, 1);
  EXPECT_FALSE(prices[1].extrapolated);
  EXPECT_EQ(prices[1].seconds, 2);
  EXPECT_TRUE(prices[2].extrapolated);
}

TEST(Accuracy, UnreachedErrorsFollowTheFittedLaw) {
  // error = 0.5 N^-0.75, time = 0.1 + 0.001 N.
  std::vector<Round> rounds;
  double spent = 0;
  for (uint64_t n = 64; n <= 512; n *= 2) {
    const auto samples = static_cast<double>(n);
    const double total = 0.1 + 0.001 * samples;
    rounds.push_back(round_of(n, 100, 0.5 * std::pow(samples, -0.75), total - spent));
    spent = total;
  }
  for (const Price& price : price_errors(rounds, 100)) {
    if (!price.extrapolated) continue;
    const double exact = std::pow(0.5 / price.error, 1 / 0.75);
    EXPECT_GE(static_cast<double>(price.samples), exact * 0.999);
    EXPECT_LE(static_cast<double>(price.samples), exact * 2.001);  // rounded up to a power of two
    EXPECT_NEAR(price.seconds, 0.1 + 0.001 * static_cast<double>(price.samples), 1e-6 * exact);
  }
}

// The slope is clamped and only looks at rounds that everyone took part in, so it may claim that an
// error was already within reach of rounds that did not reach it.
TEST(Accuracy, WhatNoRoundReachedCostsMoreThanEveryRound) {
  std::vector<Round> rounds = {round_of(256, 100, 0.2, 1), round_of(512, 100, 0.02, 1),
                               round_of(1024, 100, 0.019, 1), round_of(2048, 100, 0.018, 1)};
  rounds[2].elements = rounds[3].elements = 2;
  for (const Price& price : price_errors(rounds, 100)) {
    if (price.error >= 0.018) continue;
    EXPECT_TRUE(price.extrapolated);
    EXPECT_GE(price.samples, 4096u) << price.error;
    EXPECT_GE(price.seconds, 4) << price.error;
  }
}

TEST(Accuracy, PricesOfNothingAreZero) {
  for (const Price& price : price_errors({}, 0)) {
    EXPECT_EQ(price.seconds, 0);
    EXPECT_FALSE(price.extrapolated);
  }
}

TEST(Accuracy, PartsThatStoppedKeepTheirLastErrors) {
  ChunkReport early;
  early.elements = 10;
  early.rounds = {round_of(256, 10, 0.01, 1)};
  early.rounds[0].converged = 10;
  ChunkReport late;
  late.elements = 30;
  late.rounds = {round_of(256, 30, 0.05, 3), round_of(512, 30, 0.02, 3)};
  late.rounds[1].converged = 30;
  late.cpu_s = 5;
  late.wall_s = 6;
  early.wall_s = 1;
  const AccuracyRecord record = summarise_accuracy({early, late}, 0.03, 8, "unit");
  ASSERT_EQ(record.rounds.size(), 2u);
  EXPECT_EQ(record.rounds[1].elements, 30u);
  EXPECT_EQ(record.rounds[1].converged, 40u);
  EXPECT_NEAR(record.error_rms, std::sqrt((10 * 1e-4 + 30 * 4e-4) / 40), 1e-12);
  EXPECT_EQ(record.error_max, 0.04);
  EXPECT_EQ(record.converged_share, 1);
  EXPECT_EQ(record.elements, 40u);
  EXPECT_EQ(record.actual_s, 7);
  EXPECT_EQ(record.predicted_s, 8);
  EXPECT_EQ(record.status, AccuracyStatus::converged);
}

TEST(Accuracy, TheWorstStatusSpeaks) {
  ChunkReport report;
  report.elements = 1;
  report.rounds = {round_of(256, 1, 0.1, 1)};
  EXPECT_EQ(summarise_accuracy({report}, 0.01, 0, "").status, AccuracyStatus::converged);
  report.budget_limited = 1;
  EXPECT_EQ(summarise_accuracy({report}, 0.01, 0, "").status, AccuracyStatus::budget_limited);
  report.suspicious = 1;
  EXPECT_EQ(summarise_accuracy({report}, 0.01, 0, "").status, AccuracyStatus::suspicious);
  EXPECT_EQ(summarise_accuracy({ChunkReport{}}, 0.01, 0, "").status, AccuracyStatus::exact);
}

}  // namespace
}  // namespace lightkiln
