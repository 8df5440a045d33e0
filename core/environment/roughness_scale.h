#pragma once

// Which roughness each level of a prefiltered chain holds.

#include <vector>

namespace lightkiln {

// How engines turn perceptual roughness r into a level, as a share m of the last level:
//   linear    m = r                  glTF's sample viewer, three.js-like chains
//   filament  m = r (2 - r)          Filament and its cmgen
//   unity     m = r (1.7 - 0.7 r)    Unity's reflection probes
enum class RoughnessScale { linear, filament, unity, custom };

// The roughness of each of `levels` >= 2 levels, from 0 to 1. Not for custom.
std::vector<double> level_roughness(RoughnessScale scale, int levels);

}  // namespace lightkiln
