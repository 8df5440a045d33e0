#include "core/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lightkiln {

void RunningMoments::add(double value) {
  ++count;
  const double from_old = value - mean;
  mean += from_old / static_cast<double>(count);
  m2 += from_old * (value - mean);
}

// Chan, Golub, LeVeque, "Updating Formulae and a Pairwise Algorithm for Computing Sample
// Variances", 1979: with delta the difference of the means,
//   m2 = m2_a + m2_b + delta^2 n_a n_b / (n_a + n_b).
void RunningMoments::merge(const RunningMoments& other) {
  if (other.count == 0) return;
  if (count == 0) {
    *this = other;
    return;
  }
  const double mine = static_cast<double>(count);
  const double theirs = static_cast<double>(other.count);
  const double delta = other.mean - mean;
  mean += delta * theirs / (mine + theirs);
  m2 += other.m2 + delta * delta * mine * theirs / (mine + theirs);
  count += other.count;
}

double RunningMoments::variance() const {
  return count < 2 ? 0 : m2 / static_cast<double>(count - 1);
}

namespace {

// The regularised incomplete beta function's continued fraction by Lentz's method (Abramowitz and
// Stegun 26.5.8), for x < (a + 1) / (a + b + 2), where it converges quickly.
double beta_fraction(double a, double b, double x) {
  constexpr double kTiny = 1e-300;
  double c = 1;
  double d = 1 - (a + b) * x / (a + 1);
  d = 1 / (std::abs(d) < kTiny ? kTiny : d);
  double value = d;
  for (int m = 1; m < 400; ++m) {
    const double m2 = 2.0 * m;
    const double terms[2] = {m * (b - m) * x / ((a + m2 - 1) * (a + m2)),
                             -(a + m) * (a + b + m) * x / ((a + m2) * (a + m2 + 1))};
    double step = 1;
    for (const double term : terms) {
      d = 1 + term * d;
      d = 1 / (std::abs(d) < kTiny ? kTiny : d);
      c = 1 + term / c;
      c = std::abs(c) < kTiny ? kTiny : c;
      step = c * d;
      value *= step;
    }
    if (std::abs(step - 1) < 1e-16) break;
  }
  return value;
}

double incomplete_beta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1) / (a + b + 2)) return front * beta_fraction(a, b, x) / a;
  return 1 - front * beta_fraction(b, a, 1 - x) / b;
}

// P(|T| > t) = I_{n / (n + t^2)}(n / 2, 1 / 2) (Abramowitz and Stegun 26.7.1, 26.5.27).
double student_tail(double t, double degrees) {
  return incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
}

}  // namespace

double student_t(double confidence, int degrees_of_freedom) {
  const double degrees = std::max(1, degrees_of_freedom);
  const double tail = 1 - confidence;
  double low = 0;
  double high = 1;
  while (student_tail(high, degrees) > tail && high < 1e15) high *= 2;
  for (int i = 0; i < 200 && high - low > 1e-14 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (student_tail(middle, degrees) > tail ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// P(F > f) = I_{n / (n + m f)}(n / 2, m / 2) for m over n degrees (Abramowitz and Stegun 26.6.2).
double f_quantile(double confidence, double numerator_degrees, double denominator_degrees) {
  const double m = numerator_degrees, n = denominator_degrees, wanted = 1 - confidence;
  const auto tail = [&](double f) { return incomplete_beta(0.5 * n, 0.5 * m, n / (n + m * f)); };
  double low = 0;
  double high = 1;
  while (tail(high) > wanted && high < 1e15) high *= 2;
  for (int i = 0; i < 100 && high - low > 1e-12 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (tail(middle) > wanted ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

namespace {

double replicate_variance_of_mean(std::span<const double> means) {
  RunningMoments moments;
  for (const double mean : means) moments.add(mean);
  return moments.variance() / static_cast<double>(std::max<size_t>(means.size(), 1));
}

int degrees(std::span<const double> means) {
  return static_cast<int>(means.size()) - 1;
}

}  // namespace

double replicate_half_width(std::span<const double> replicate_means, double confidence) {
  if (replicate_means.size() < 2) return INFINITY;
  return student_t(confidence, degrees(replicate_means)) *
         std::sqrt(replicate_variance_of_mean(replicate_means));
}

// What equal replicates hide is a feature too small for the points: one that covers a share q of
// the domain is missed by all n samples with probability about exp(-n q) however well they are
// stratified, because stratification gains nothing below its cells. Such a feature follows the
// binomial law. With two successes and two failures added (Agresti and Coull, "Approximate Is
// Better than 'Exact'", The American Statistician 52(2), 1998),
//   p' = (n p + 2) / (n + 4),   q = min(p', 1 - p', 4 / (n + 4)),
//   variance of the mean >= q (1 - q) / (n + 4).
// Near 0 and 1 this is the binomial variance itself; in between the cap of four counts keeps the
// gain of stratified points, which binomial variance would throw away. The floor is never zero: no
// event in n samples leaves a half-width of about 3 / n.
double bounded_standard_error(std::span<const double> replicate_means, uint64_t total_samples) {
  if (replicate_means.size() < 2) return INFINITY;
  double mean = 0;
  for (const double value : replicate_means) mean += value;
  mean /= static_cast<double>(replicate_means.size());
  const double n = static_cast<double>(total_samples);
  const double success = (n * std::clamp(mean, 0.0, 1.0) + 2) / (n + 4);
  const double q = std::min({success, 1 - success, 4 / (n + 4)});
  const double floor = q * (1 - q) / (n + 4);
  return std::sqrt(std::max(replicate_variance_of_mean(replicate_means), floor));
}

double bounded_half_width(std::span<const double> replicate_means, uint64_t total_samples,
                          double confidence) {
  if (replicate_means.size() < 2) return INFINITY;
  return student_t(confidence, degrees(replicate_means)) *
         bounded_standard_error(replicate_means, total_samples);
}

double spent_alpha(double alpha, int look) {
  return alpha / (static_cast<double>(look) * (look + 1));
}

double look_quantile(int look) {
  static const std::array<double, 32> table = [] {
    std::array<double, 32> values{};
    for (int k = 1; k < 32; ++k)
      values[static_cast<size_t>(k)] = student_t(1 - spent_alpha(0.05, k), kReplicates - 1);
    return values;
  }();
  return table[static_cast<size_t>(std::clamp(look, 1, 31))];
}

void TailGuard::add(double value) {
  ++count;
  const double square = value * value;
  sum += value;
  sum2 += square;
  sum3 += square * value;
  sum4 += square * square;
  largest = std::max(largest, value);
}

void TailGuard::merge(const TailGuard& other) {
  count += other.count;
  sum += other.sum;
  sum2 += other.sum2;
  sum3 += other.sum3;
  sum4 += other.sum4;
  largest = std::max(largest, other.largest);
}

// Kurtosis from raw moments m_k = sum_k / n: (m4 - 4 m m3 + 6 m^2 m2 - 3 m^4) / (m2 - m^2)^2. Only
// its order of magnitude is asked for, so the cancellation does no harm. A variance estimated from
// n values is known to within a relative (kurtosis - 1) / n of squared standard error; under 1/16
// that is better than what sixteen replicates tell (2/15), and no reason for doubt.
bool TailGuard::suspicious() const {
  if (count < 64 || sum <= 0) return false;
  if (largest > 0.1 * sum) return true;
  const double n = static_cast<double>(count);
  const double mean = sum / n;
  const double variance = sum2 / n - mean * mean;
  if (variance <= 1e-9 * mean * mean) return false;
  const double fourth =
      sum4 / n - 4 * mean * sum3 / n + 6 * mean * mean * sum2 / n - 3 * mean * mean * mean * mean;
  return fourth > std::max(100.0, n / 16) * variance * variance;
}

namespace {

template <typename T>
double halved_sum(std::span<const T> values) {
  constexpr size_t kBlock = 1024;
  if (values.size() <= kBlock) {
    double sum = 0;
    for (const T value : values) sum += static_cast<double>(value);
    return sum;
  }
  const size_t blocks = (values.size() + kBlock - 1) / kBlock;
  const size_t middle = (blocks + 1) / 2 * kBlock;
  return halved_sum(values.first(middle)) + halved_sum(values.subspan(middle));
}

}  // namespace

double tree_sum(std::span<const double> values) {
  return halved_sum(values);
}
double tree_sum(std::span<const float> values) {
  return halved_sum(values);
}

}  // namespace lightkiln
