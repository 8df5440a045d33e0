// Sources: Filament, shaders/src/light_indirect.fs and libs/ibl/src/CubemapIBL.cpp; Unity,
// ImageBasedLighting.hlsl (PerceptualRoughnessToMipmapLevel); Khronos glTF-Sample-Viewer, ibl.glsl.

#include "core/environment/roughness_scale.h"

#include <cassert>
#include <cmath>

namespace lightkiln {

// r (b - (b - 1) r) = m is solved by 2 m / (b + sqrt(b^2 - 4 (b - 1) m)), which does not cancel.
std::vector<double> level_roughness(RoughnessScale scale, int levels) {
  assert(levels >= 2 && scale != RoughnessScale::custom);
  const double b = scale == RoughnessScale::filament ? 2.0
                   : scale == RoughnessScale::unity  ? 1.7
                                                     : 1.0;
  std::vector<double> roughness;
  for (int level = 0; level < levels; ++level) {
    const double m = double(level) / (levels - 1);
    roughness.push_back(2 * m / (b + std::sqrt(b * b - 4 * (b - 1) * m)));
  }
  return roughness;
}

}  // namespace lightkiln
