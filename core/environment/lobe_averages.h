#pragma once

// What a convolution ought to give: the lobe's integral over every texel of the map by Gauss points
// in double precision, times the texel. Too slow to bake with, and therefore what a few texels of
// each bake are held against. It shares no step with the chain that it judges.

#include <span>
#include <vector>

#include "core/base/parallel.h"
#include "core/environment/environment.h"
#include "core/environment/twin_lobe.h"

namespace lightkiln {

struct LobeAverages {
  std::vector<Vec3d> means;  // one for each axis
  double error = 0;          // no channel of any mean errs by more
};

// The lobe's averages of the map, constant on each texel, about each of `axes` (unit vectors). The
// same bits for any number of threads and any other axes.
LobeAverages lobe_averages(const Environment& environment, const TwinLobe& lobe,
                           std::span<const Vec3d> axes, int threads, Progress& progress);

}  // namespace lightkiln
