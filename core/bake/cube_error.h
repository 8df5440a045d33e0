#pragma once

// The error of a cube of texels from its replicates: how large the root mean square over the sphere
// of its texels' errors can be.

#include <cstddef>
#include <vector>

#include "core/base/statistics.h"

namespace lightkiln {

// A rule that doubles the samples until the bound is within an order looks more than once and picks
// the look at which variance seems small. Sixteen replicates seldom claim much less than the truth,
// and where they do not, a doubling leaves slack, so that this much confidence at each look keeps
// the order, and the bound told at the end, in 95 % of bakes.
inline constexpr double kLookConfidence = 0.975;

// The law of Q, the mean square over the sphere of the errors of texels that are means over
// replicates.
struct CubeError {
  double mean_square = 0;       // estimate of the expectation of Q
  double effective_texels = 1;  // how many equal and independent texels would spread Q as much
  // With `confidence` the root of Q is at most this.
  double bound(double confidence) const;
};

// Gathers texels in any fixed order.
class CubeErrorSum {
 public:
  // `means` of kReplicates replicates; `share` of the sphere.
  void add(const double* means, double share);
  CubeError result() const;

 private:
  size_t texels_ = 0;
  // Inner products over texels, weighted by shares, of the replicates' deviations from their mean.
  double products_[kReplicates][kReplicates] = {};
};

}  // namespace lightkiln
