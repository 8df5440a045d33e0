#pragma once

// Slow, plain double-precision twins of what core/sphere and core/environment do by fast routes.

#include <vector>

#include "core/environment/environment.h"
#include "core/sphere/harmonics.h"

namespace lightkiln::reference {

// Coefficients by summing over every texel, each cut into `cuts` x `cuts` cells of equal longitude
// and colatitude steps with its exact solid angle.
ShRgb project(const Image& latlong, int bands, int cuts);

// The GGX lobe with n = v = r at roughness^2 = alpha, unnormalised: D(h) n.l with h between n and
// l, written from the half vector, not from the angle.
double ggx_lobe(double alpha, double cosine);

// Average of the map under the normalised lobe about `axis`: every texel, cut where the lobe is
// narrower than the texel.
Vec3d prefilter(const Image& latlong, double alpha, const Vec3d& axis);

// Irradiance by the same sum with a clamped cosine.
Vec3d irradiance(const Image& latlong, const Vec3d& normal);

// Mean of the map over one cube texel, by `cuts` x `cuts` points weighted by solid angle.
Vec3d cube_texel_mean(const Image& latlong, int face, int x, int y, int size, int cuts);

// The split-sum pair (A, B) by midpoints over the hemisphere of half vectors.
struct Dfg {
  double scale = 0, bias = 0;
};
Dfg dfg(double alpha, double cosine, int steps);

// A map with a sun, a gradient and noise, width 2 height.
Image test_sky(int height, double sun_radiance);

}  // namespace lightkiln::reference
