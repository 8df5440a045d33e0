#pragma once

// The split-sum table of GGX with height-correlated Smith masking: the reflected share of white
// light is F0 scale + bias, with Schlick's Fresnel term.

#include "core/base/progress.h"
#include "core/image/image.h"

namespace lightkiln {

struct DfgValue {
  double scale = 0;  // multiplies F0
  double bias = 0;
};

// alpha = roughness^2 in (0, 1]; cosine = n.v in (0, 1]. Single scattering. `refinement` multiplies
// the points of each dimension of the quadrature; 1 is what tables are made with.
DfgValue ggx_dfg(double alpha, double cosine, int refinement = 1);

// The largest error of either value over alpha in [1e-7, 1] and cosine in [1/2048, 1], against
// refinement 8.
inline constexpr double kDfgErrorBound = 1e-5;

// size x size, three channels: R = scale, G = bias, B = 0. Column x holds n.v = (x + 1/2) / size,
// row y (from the top) roughness = (y + 1/2) / size.
Image ggx_dfg_table(int size, int threads, Progress& progress);

}  // namespace lightkiln
