#pragma once

// Means, variances and confidence half-widths from independent replicates.

#include <cstdint>
#include <span>

namespace lightkiln {

// The default number of independent scramblings behind an error bar.
inline constexpr int kReplicates = 16;

// Welford's update in double; merge() is Chan's, exact in any fixed order.
struct RunningMoments {
  uint64_t count = 0;
  double mean = 0;
  double m2 = 0;

  void add(double value);
  void merge(const RunningMoments& other);
  double variance() const;  // of a sample, n - 1; 0 for fewer than two values
};

// The two-sided quantile of Student's t: P(|T| <= t) = confidence.
double student_t(double confidence, int degrees_of_freedom);

// The quantile of Fisher's F: P(F <= f) = confidence, for the ratio of two mean squares with the
// given degrees of freedom (above 0, need not be whole; the second at least as large as 1).
double f_quantile(double confidence, double numerator_degrees, double denominator_degrees);

// 95 % confidence half-width of the mean of `replicate_means`: t_{R-1} * s / sqrt(R).
double replicate_half_width(std::span<const double> replicate_means, double confidence = 0.95);

// The standard error of a mean in [0, 1] from R replicate means of `total_samples` samples in all:
// the replicates' own, floored by what they cannot show. Never zero.
double bounded_standard_error(std::span<const double> replicate_means, uint64_t total_samples);

// t_{R-1} times bounded_standard_error: never trusts zero variance.
double bounded_half_width(std::span<const double> replicate_means, uint64_t total_samples,
                          double confidence = 0.95);

// Tells when a mean of non-negative values hangs on few of them, so that its variance estimate
// cannot be trusted: one value holds more than a tenth of the sum, or the kurtosis exceeds both 100
// and a sixteenth of the count. Judges from 64 values on.
struct TailGuard {
  uint64_t count = 0;
  double sum = 0, sum2 = 0, sum3 = 0, sum4 = 0;
  double largest = 0;

  void add(double value);
  void merge(const TailGuard& other);
  bool suspicious() const;
};

// A sum in double over a fixed tree (halves, down to blocks of 1024): the same bits whoever
// computes it, error growing with the logarithm of the length.
double tree_sum(std::span<const double> values);
double tree_sum(std::span<const float> values);

// Level to spend at the k-th look (k = 1, 2, ...) so that all looks together spend alpha:
// alpha / (k (k + 1)).
double spent_alpha(double alpha, int look);

// Student's two-sided quantile for kReplicates at the k-th look (k = 1, 2, ..., at most 31) of a
// rule that stops once this many standard errors are within the target: all looks together spend
// 5 %.
double look_quantile(int look);

}  // namespace lightkiln
