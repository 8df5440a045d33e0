#pragma once

// What a band limit cuts off the brightest texels, in closed form.

#include <vector>

#include "core/environment/light_statistics.h"
#include "core/environment/lobe.h"

namespace lightkiln {

// The bright texels as points, and the part of a kernel that bands l < responses.size() lack.
class CutLight {
 public:
  CutLight(const LightStatistics& light, const ZonalKernel& kernel,
           const std::vector<double>& responses);
  // To be added to the band-limited convolution at this direction.
  Vec3d at(const Vec3d& direction) const;

 private:
  std::vector<double> x_, y_, z_;  // directions of the points
  std::vector<Vec3d> energy_;
  std::vector<double> table_;  // by angle, in equal steps from 0 to pi, and one more
};

// What taking texels for points may leave, when bands l < bands are cut: rms over the sphere
// relative to the mean. `responses` reach beyond `bands` as far as they are known.
double cut_light_bound(const LightStatistics& light, const std::vector<double>& responses,
                       int bands);

}  // namespace lightkiln
