#pragma once

// The integral of a lobe over a part of the sphere between two longitudes and two colatitudes, to
// kTwinError of itself.

#include <vector>

#include "core/environment/twin_lobe.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

// Colatitudes in [0, pi]; longitudes count from the axis' own: a patch reaches into [-pi, pi] and
// at most as far beyond it.
struct Patch {
  double top, bottom;
  double left, right;
};

class PatchIntegral {
 public:
  // The lobe must outlive the object.
  PatchIntegral(const TwinLobe& lobe, double axis_colatitude_rad);
  // `horizon_points` above 0: the patch is known to lie about the horizon and to be small enough
  // for a rule of so many points, at least 3.
  double operator()(const Patch& patch, int horizon_points = 0) const;

  // The longitude from the axis' own at which a parallel leaves the hemisphere about the axis: 0
  // where all of it lies below, pi where all of it lies above.
  double horizon_longitude(double colatitude_rad) const;

 private:
  double beside(double colatitude, double longitude) const;
  double refined(const Patch& patch, double smallest) const;
  double plain(const Patch& patch, int points) const;
  double clipped(const Patch& patch, int points) const;
  // The part of the meridian at a longitude that lies above the horizon, cut to the patch.
  struct Stretch {
    double from, to;
  };
  Stretch meridian_above(const Patch& patch, double longitude) const;
  Stretch parallel_above(const Patch& patch, double colatitude) const;
  double along_meridian(const Stretch& above, double longitude, const GaussRule& rule) const;
  double along_parallel(const Stretch& above, double colatitude, const GaussRule& rule) const;

  const TwinLobe& lobe_;
  double empty_, smallest_;
  double axis_, sine_, cosine_;
};

// Gauss points of up to 7 a side.
const GaussRule& patch_rule(int points);

}  // namespace lightkiln
