#include "core/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"

namespace lightkiln {
namespace {

double uniform(uint64_t index) {
  return static_cast<double>(hash64(index) >> 11) * 0x1p-53;
}
double normal(uint64_t index) {
  return std::sqrt(-2 * std::log(1 - uniform(2 * index))) *
         std::cos(6.283185307179586 * uniform(2 * index + 1));
}

TEST(Statistics, QuantilesOfStudentMatchTheTables) {
  EXPECT_NEAR(student_t(0.95, 1), 12.7062047, 1e-6);
  EXPECT_NEAR(student_t(0.95, 2), 4.30265273, 1e-7);
  EXPECT_NEAR(student_t(0.90, 5), 2.01504837, 1e-7);
  EXPECT_NEAR(student_t(0.95, 15), 2.13144955, 1e-7);
  EXPECT_NEAR(student_t(0.99, 15), 2.94671288, 1e-7);
  EXPECT_NEAR(student_t(0.95, 1000000), 1.95996, 1e-4);
}

// Tables of F; one degree of freedom gives the square of Student's t.
TEST(Statistics, FQuantilesMatchTables) {
  EXPECT_NEAR(f_quantile(0.95, 2, 15), 3.68232, 1e-5);
  EXPECT_NEAR(f_quantile(0.95, 10, 20), 2.34788, 1e-5);
  EXPECT_NEAR(f_quantile(0.99, 5, 30), 3.69902, 1e-5);
  EXPECT_NEAR(f_quantile(0.95, 1, 15), std::pow(student_t(0.95, 15), 2), 1e-9);
  EXPECT_NEAR(f_quantile(0.999, 1, 15), std::pow(student_t(0.999, 15), 2), 1e-8);
  // Many degrees: close to 1.
  EXPECT_NEAR(f_quantile(0.5, 4096, 61440), 1, 1e-3);
  EXPECT_LT(f_quantile(0.95, 4096, 61440), 1.04);
}

TEST(Statistics, SumOfManyEqualFloatsIsExact) {  // R1
  const std::vector<float> ones(40'000'000, 1.0f);
  EXPECT_EQ(tree_sum(ones), 4e7);
  // Positive control: a float sum stalls at 2^24.
  float naive = 0;
  for (const float one : ones) naive += one;
  EXPECT_LT(naive, 2e7f);
}

TEST(Statistics, VarianceSurvivesALargeMean) {  // R2
  RunningMoments moments;
  float sum = 0, sum2 = 0;
  constexpr uint64_t n = 100000;
  for (uint64_t i = 0; i < n; ++i) {
    const double x = 1e4 + 0.1 * normal(i);
    moments.add(x);
    const float f = static_cast<float>(x);
    sum += f;
    sum2 += f * f;
  }
  EXPECT_NEAR(moments.variance(), 0.01, 2e-4);
  const float mean = sum / n;
  EXPECT_GT(std::abs(sum2 / n - mean * mean - 0.01f), 0.01f);  // positive control
}

RC_GTEST_PROP(Statistics, MergedMomentsEqualThoseOfTheWhole, (std::vector<int16_t> values)) {
  const size_t cut = values.size() / 3;
  RunningMoments whole, head, tail;
  for (size_t i = 0; i < values.size(); ++i) {
    whole.add(values[i]);
    (i < cut ? head : tail).add(values[i]);
  }
  head.merge(tail);
  RC_ASSERT(head.count == whole.count);
  RC_ASSERT(std::abs(head.mean - whole.mean) <= 1e-9 * 32768);
  RC_ASSERT(std::abs(head.variance() - whole.variance()) <= 1e-9 * (1 + whole.variance()));
  RC_ASSERT(head.variance() >= 0);
}

TEST(Statistics, SumsDoNotDependOnThreads) {  // R3
  std::vector<float> values(1 << 20);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(normal(i));
  const double expected = tree_sum(values);
  for (const int threads : {1, 2, 3, 8}) {
    // Owners fill blocks in any order; the tree over the blocks is fixed.
    constexpr size_t kBlock = 1024;
    std::vector<double> partial(values.size() / kBlock);
    Progress progress;
    parallel_blocks(values.size(), kBlock, threads, progress, [&](size_t begin, size_t end) {
      partial[begin / kBlock] = tree_sum(std::span(values).subspan(begin, end - begin));
    });
    const auto fold = [](const auto& self, std::span<const double> part) -> double {
      return part.size() == 1 ? part[0]
                              : self(self, part.first(part.size() / 2)) +
                                    self(self, part.subspan(part.size() / 2));
    };
    EXPECT_EQ(fold(fold, partial), expected) << threads;
  }
}

// One adaptive estimate of a Bernoulli mean by the stopping rule: 16 replicates of 16, doubled.
struct Stop {
  double mean = 0;
  double half_width = 0;
};
Stop estimate_bernoulli(double p, double target, uint64_t seed) {
  double hits[kReplicates] = {};
  double means[kReplicates];
  uint64_t points = 0;
  uint64_t draw = hash64(seed);
  for (int look = 1;; ++look) {
    const uint64_t wanted = 16ull << (look - 1);
    for (; points < wanted; ++points)
      for (double& hit : hits) hit += uniform(draw++) < p ? 1 : 0;
    double mean = 0;
    for (size_t r = 0; r < kReplicates; ++r) {
      means[r] = hits[r] / static_cast<double>(points);
      mean += means[r] / kReplicates;
    }
    const uint64_t n = points * kReplicates;
    if (bounded_half_width(means, n, 1 - spent_alpha(0.05, look)) <= target || n >= 1u << 20)
      return {mean, bounded_half_width(means, n)};
  }
}

TEST(Statistics, RareEventsAreNotTakenForCertainty) {  // T1
  for (const double p : {0.5, 0.1, 0.02}) {
    int within = 0;
    double bias = 0;
    constexpr int kRuns = 2000;
    for (int run = 0; run < kRuns; ++run) {
      const Stop stop = estimate_bernoulli(p, 0.02, static_cast<uint64_t>(run));
      within += std::abs(stop.mean - p) <= 0.02;
      bias += (stop.mean - p) / kRuns;
    }
    EXPECT_GE(within, 0.93 * kRuns) << p;
    EXPECT_LE(std::abs(bias), 0.1 * p) << p;
  }
  // Positive control: without the floor, all-equal replicates claim certainty.
  const double zeros[kReplicates] = {};
  EXPECT_EQ(replicate_half_width(zeros), 0);
  EXPECT_GT(bounded_half_width(zeros, 64), 0.03);
  EXPECT_LT(bounded_half_width(zeros, 1024), 0.005);
}

// X = 1 + 100 Bernoulli(0.005), mean 1.5, doubled from `fewest` samples until 5 % of the mean is
// claimed. A run is fooled that claims so, suspects nothing (when it may), and is off by over three
// times its claim.
struct TailRun {
  bool fooled = false;
  bool suspected = false;  // at the first look
};
TailRun tail_run(uint64_t run, uint64_t fewest, bool guarded) {
  TailGuard guard;
  double sums[kReplicates] = {};
  uint64_t taken = 0;
  TailRun result;
  for (uint64_t n = fewest; n <= 1u << 14; n *= 2) {
    for (; taken < n; ++taken) {
      const double x = uniform(hash_combine(run, taken)) < 0.005 ? 101 : 1;
      guard.add(x);
      sums[taken % kReplicates] += x;
    }
    if (n == fewest) result.suspected = guard.suspicious();
    double means[kReplicates], mean = 0;
    for (size_t r = 0; r < kReplicates; ++r) {
      means[r] = sums[r] * kReplicates / static_cast<double>(n);
      mean += means[r] / kReplicates;
    }
    const double half = replicate_half_width(means);
    if (half > 0.05 * mean) continue;
    result.fooled = std::abs(mean - 1.5) > 3 * half && !(guarded && guard.suspicious());
    break;
  }
  return result;
}

// What was never met cannot be suspected, so the guard needs 64 samples in each of 16 replicates:
// then a tail of one in 200 is met by all but 0.6 % of runs, and told by the guard.
TEST(Statistics, HeavyTailsAreCalledSuspicious) {  // T2
  int fooled = 0, unguarded = 0, suspected = 0;
  constexpr int kRuns = 1000;
  for (uint64_t run = 0; run < kRuns; ++run) {
    const TailRun guarded = tail_run(run, 1024, true);
    fooled += guarded.fooled;
    suspected += guarded.suspected;
    unguarded += tail_run(run, 16, false).fooled;
  }
  EXPECT_LE(fooled, 0.05 * kRuns);
  EXPECT_GE(suspected, 0.9 * kRuns);
  EXPECT_GE(unguarded, 0.85 * kRuns);  // positive control: 0.995^16 = 92 % meet nothing at first
  TailGuard calm;
  for (uint64_t i = 0; i < 1024; ++i) calm.add(uniform(i));
  EXPECT_FALSE(calm.suspicious());
  TailGuard constant;
  for (uint64_t i = 0; i < 1024; ++i) constant.add(0.3);
  EXPECT_FALSE(constant.suspicious());
}

TEST(Statistics, ReplicatesCoverWhereIndependenceOverstates) {  // T3
  // Smooth integrand on 16 scrambled nets of 64 points.
  int covered = 0;
  double claimed = 0, actual = 0;
  constexpr int kRuns = 2000;
  for (uint64_t run = 0; run < kRuns; ++run) {
    double means[kReplicates];
    RunningMoments all;
    for (size_t r = 0; r < kReplicates; ++r) {
      double sum = 0;
      for (uint32_t i = 0; i < 64; ++i) {
        const Point2 p = sobol2(hash_combine(run, r), i);
        const double f = static_cast<double>(p.x) * static_cast<double>(p.y) * 4;
        sum += f;
        all.add(f);
      }
      means[r] = sum / 64;
    }
    double mean = 0;
    for (const double m : means) mean += m / kReplicates;
    covered += std::abs(mean - 1) <= replicate_half_width(means);
    claimed += std::sqrt(all.variance() / 1024) / kRuns;
    actual += (mean - 1) * (mean - 1) / kRuns;
  }
  EXPECT_GE(covered, 0.93 * kRuns);
  EXPECT_LE(covered, 0.97 * kRuns);
  EXPECT_GT(claimed, 2 * std::sqrt(actual));  // positive control
}

TEST(Statistics, LooksSpendNoMoreThanAlpha) {
  double spent = 0;
  for (int look = 1; look < 1000; ++look) spent += spent_alpha(0.05, look);
  EXPECT_LT(spent, 0.05);
  EXPECT_GT(spent, 0.0499);
}

}  // namespace
}  // namespace lightkiln
