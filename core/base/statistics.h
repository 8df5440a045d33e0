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

// 95 % confidence half-width of the mean of `replicate_means`: t_{R-1} * s / sqrt(R).
double replicate_half_width(std::span<const double> replicate_means, double confidence = 0.95);

// The same for a quantity in [0, 1] seen `total_samples` times: never trusts zero variance. The
// variance is floored by that of a binomial with two successes and two failures added (Agresti and
// Coull 1998), scaled by the quasi-Monte Carlo gain that all-equal replicates cannot show.
double bounded_half_width(std::span<const double> replicate_means, uint64_t total_samples,
                          double confidence = 0.95);

// Level to spend at the k-th look (k = 1, 2, ...) so that all looks together spend alpha:
// alpha / (k (k + 1)).
double spent_alpha(double alpha, int look);

}  // namespace lightkiln
