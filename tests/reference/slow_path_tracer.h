#pragma once

// A path tracer that shares nothing with the engine's: double precision, every triangle tested by
// every ray, cosine sampling alone, the standard library's generator. Untextured scenes; the
// engine's rules of light otherwise.

#include <cstdint>

#include "core/base/math.h"
#include "core/scene/scene.h"

namespace lightkiln::reference {

struct SlowEstimate {
  Vec3d mean;
  Vec3d standard_error;
};

// `origin` in normalised space, `direction` unit. `sky` is constant radiance where nothing is hit.
SlowEstimate slow_radiance(const Scene& scene, const Vec3d& sky, const Vec3d& origin,
                           const Vec3d& direction, int bounces, int paths, uint64_t seed);

}  // namespace lightkiln::reference
