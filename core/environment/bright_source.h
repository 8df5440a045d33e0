#pragma once

// Finds what in a map is brightest and compact.

#include <string>
#include <vector>

#include "core/environment/latlong_grid.h"

namespace lightkiln {

struct SourceLimits {
  double max_angular_radius_rad = 0;  // of a texel centre from the source's luminous centre, > 0
  double min_contrast = 0;            // of `peak` to `cut`, >= 1
};

struct BrightSource {
  std::vector<Texel> texels;  // the source; empty: there is none, and `reason` says why
  double peak = 0;            // the map's highest luminance
  double cut = 0;             // the luminance from which texels belong to the source
  std::string reason;         // one sentence
};

// One for each connected set of texels that have the map's highest luminance, the largest set
// first; as many as a clipped map may have, but at most 16. `peak` is that luminance, > 0.
std::vector<BrightSource> bright_sources(const LatlongGrid& grid, double peak,
                                         const SourceLimits& limits);

}  // namespace lightkiln
