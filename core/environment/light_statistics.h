#pragma once

// What a convolution must know of a map before it plans: range, spread, and the texels that hold
// most of it.

#include <vector>

#include "core/environment/environment.h"

namespace lightkiln {

// A texel so bright that what a band limit cuts off it would be seen.
struct BrightTexel {
  Vec3d direction;
  Vec3d energy;       // radiance times solid angle
  double extent_rad;  // the longer side
};

struct LightStatistics {
  int map_height = 0;    // rows of the map
  Vec3 lowest, highest;  // per channel: no convolution leaves this range
  Vec3d mean;
  double mean_luminance = 0;
  // Standard deviation over the sphere relative to mean_luminance (largest channel), with and
  // without the bright texels; their share of all energy.
  double spread = 0;
  double rest_spread = 0;
  double bright_share = 0;
  std::vector<BrightTexel> bright;  // at most kMaxBrightTexels, brightest first
};
inline constexpr int kMaxBrightTexels = 96;
LightStatistics measure_light(const Environment& environment);

}  // namespace lightkiln
