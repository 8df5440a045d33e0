#pragma once

// Draws directions in proportion to an environment's luminance, or to what of it exceeds a floor,
// exactly: a texel by its luminance times its true solid angle, then a point of its spherical
// rectangle uniform in solid angle.

#include <cstdint>
#include <vector>

#include "core/environment/environment.h"

namespace lightkiln {

class EnvironmentSampler {
 public:
  // The density follows max(0, luminance - floor): texels at the floor and under are never drawn,
  // so that a floor above 0 needs a second technique that reaches them.
  explicit EnvironmentSampler(const Environment& environment, double floor = 0);

  struct Sample {
    Vec3 direction;
    Vec3 radiance;
    float pdf = 0;  // per steradian; always > 0
  };
  // u, v in [0, 1).
  Sample sample(float u, float v) const;
  // The density with which sample() returns `direction`.
  float pdf(const Vec3& direction) const;

  // True when no texel exceeds the floor: the density is then uniform, 1/(4 pi).
  bool black() const { return black_; }

 private:
  const Environment* environment_;
  bool black_ = false;
  std::vector<double> row_cdf_;    // height + 1
  std::vector<double> texel_cdf_;  // height rows of width + 1, each row normalised
  double texel_pdf(int x, int y) const;
};

// The floor for a sampler that shares its samples half and half with another technique under the
// balance heuristic (MIS compensation): it leaves to the other what that one samples well enough.
// At most the mean luminance, at least half of it; 0 for a black map.
double mis_compensation_floor(const Environment& environment);

}  // namespace lightkiln
