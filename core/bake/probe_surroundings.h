#pragma once

// Where a probe stands: inside a solid, on a surface, or free; and how far its surroundings are.

#include <cstdint>
#include <vector>

#include "core/bake/documents.h"
#include "core/base/random.h"
#include "core/trace/tracer.h"

namespace lightkiln {

// Uniform over the sphere for points uniform in the square.
Vec3 uniform_direction(const Point2& u);

struct ProbeSurroundings {
  ProbeStatus status = ProbeStatus::valid;
  double backface_share = 0;  // of the rays that hit
  double hit_share = 0;       // of all rays
  double distance_mean = 0;   // world units, over rays that hit; 0 when none does
  double distance_min = 0;
};

// 1024 rays, uniform over the sphere. on_surface: over a tenth meet something within 1e-4 of the
// scene's longest side. inside_geometry: over a quarter of the hits are backs of single-sided
// surfaces (a double-sided one may be seen from either side and tells nothing).
ProbeSurroundings probe_surroundings(const Tracer& tracer, const Vec3& origin, uint64_t key,
                                     RayCounters& counters);

// The distance along the ray through the centre of every texel of the stacked cube, world units;
// 0 where nothing is hit.
std::vector<float> probe_distances(const Tracer& tracer, const Vec3& origin, int size,
                                   RayCounters& counters);

}  // namespace lightkiln
