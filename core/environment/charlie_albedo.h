#pragma once

// How much white light a sheen layer reflects: the third channel of DFG tables.

namespace lightkiln {

// integral over the upper hemisphere of D(h) V(l, v) n.l dl, with Charlie's distribution and the
// visibility 1 / (4 (n.l + n.v - n.l n.v)). alpha = roughness^2 in (0, 1]; cosine = n.v in (0, 1].
// The model does not conserve energy: at grazing views of low roughness the value exceeds 1.
// `refinement` multiplies the points of each dimension of the quadrature.
double charlie_albedo(double alpha, double cosine, int refinement = 1);

// The largest error over roughness in [1/256, 1] and cosine in [1/256, 1], relative to max(1,
// value), against refinement 6.
inline constexpr double kCharlieAlbedoErrorBound = 1e-5;

}  // namespace lightkiln
