#include "core/bake/cube_error.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

namespace {

// Past so many the quantile hardly moves, and the beta function's fraction stays short.
constexpr double kMostEffective = 4096;

}  // namespace

// Let e_r be replicate r's errors, a vector over texels scaled by the roots of their shares, with
// covariance C, and R replicates. Their mean's Q has expectation tr C / R, which S = tr of the
// sample covariance / R estimates. When Q is spread like a chi-square of m degrees over m, its
// variance is 2/m (tr C / R)^2; for normal errors it is 2 tr C^2 / R^2, so that
//   m = (tr C)^2 / tr C^2
// (Satterthwaite, "An Approximate Distribution of Estimates of Variance Components", 1946). S has
// (R - 1) m degrees likewise and is independent, so Q / S follows F. One texel gives m = 1 and the
// root of F Student's t; many give a bound close to the root of S itself.
double CubeError::bound(double confidence) const {
  if (!(mean_square > 0)) return 0;
  const double m = std::min(effective_texels, kMostEffective);
  return std::sqrt(mean_square * f_quantile(confidence, m, (kReplicates - 1) * m));
}

void CubeErrorSum::add(const double* means, double share) {
  double mean = 0;
  for (int r = 0; r < kReplicates; ++r) mean += means[r] / kReplicates;
  double deviations[kReplicates];
  for (int r = 0; r < kReplicates; ++r) deviations[r] = means[r] - mean;
  for (int r = 0; r < kReplicates; ++r) {
    const double scaled = share * deviations[r];
    for (int s = 0; s <= r; ++s) products_[r][s] += scaled * deviations[s];
  }
  ++texels_;
}

// tr C^2 from the products G_rs = <d_r, d_s> of deviations, with K the sample covariance,
// tr K = sum G_rr / (R - 1), tr K^2 = sum G_rs^2 / (R - 1)^2, Q = sum G_rr^2 / (R - 1):
//   (R - 1) / (R (R - 2) (R - 3)) ((R - 1) (R - 2) tr K^2 + (tr K)^2 - R Q),
// unbiased whatever the errors' distribution and however they depend on each other (Himeno and
// Yamada, "Estimations for some functions of covariance matrix in high dimension under
// non-normality", Journal of Multivariate Analysis 130, 2014). Kept where a covariance can be.
CubeError CubeErrorSum::result() const {
  constexpr double kR = kReplicates;
  double trace = 0, squares = 0, fourths = 0;
  for (int r = 0; r < kReplicates; ++r) {
    trace += products_[r][r];
    fourths += products_[r][r] * products_[r][r];
    for (int s = 0; s < r; ++s) squares += 2 * products_[r][s] * products_[r][s];
  }
  squares += fourths;
  trace /= kR - 1;
  if (!(trace > 0)) return {};
  const double square_trace =
      (kR - 1) / (kR * (kR - 2) * (kR - 3)) *
      ((kR - 2) / (kR - 1) * squares + trace * trace - kR / (kR - 1) * fourths);
  const double all = static_cast<double>(texels_);
  const double effective = trace * trace / std::max(square_trace, trace * trace / all);
  return {trace / kR, std::max(effective, 1.0)};
}

}  // namespace lightkiln
