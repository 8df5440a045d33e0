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
// the points of each dimension of the quadrature, 1..16; 1 is what tables are made with.
DfgValue ggx_dfg(double alpha, double cosine, int refinement = 1);

// The largest error of either value over alpha in [1e-7, 1] and cosine in [1/2048, 1], against
// refinement 8.
inline constexpr double kDfgErrorBound = 1e-5;

// What an infinitely deep play of reflections between microfacets would give back, as engines
// estimate it: reflected = (F0 scale + bias) (1 + F0 (1 / E - 1)), E = scale + bias, which is 1 for
// F0 = 1.
double compensated_reflectance(const DfgValue& value, double f0);

// What a table's channels hold.
struct DfgTableOptions {
  // false: R = scale, G = bias, as glTF viewers read: F0 R + G.
  // true: R = bias, G = E = scale + bias, as Filament reads for energy compensation:
  // mix(R, G, F0) (1 + F0 (1 / G - 1)).
  bool multiple_scattering = false;
  bool charlie = false;  // B = charlie_albedo(), else 0
};
// size x size, three channels. Column x holds n.v = (x + 1/2) / size, row y (from the top)
// roughness = (y + 1/2) / size.
Image dfg_table(int size, const DfgTableOptions& options, int threads, Progress& progress);

}  // namespace lightkiln
