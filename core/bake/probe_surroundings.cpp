#include "core/bake/probe_surroundings.h"

#include <algorithm>
#include <cmath>

#include "core/base/pinned_math.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

constexpr uint32_t kSurroundingRays = 1024;
constexpr double kTouchingDistance = 1e-4;  // of the scene's longest side
constexpr double kTouchingShare = 0.1;
constexpr double kInsideShare = 0.25;

}  // namespace

// z and azimuth are uniform (Archimedes).
Vec3 uniform_direction(const Point2& u) {
  const double z = 1 - 2 * static_cast<double>(u.x);
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  const SinCos around = pinned_sin_cos(2 * kPi * static_cast<double>(u.y));
  return to_float({r * around.cos, r * around.sin, z});
}

ProbeSurroundings probe_surroundings(const Tracer& tracer, const Vec3& origin, uint64_t key,
                                     RayCounters& counters) {
  const Scene& scene = tracer.scene();
  const Vec3d extent = scene.bounds.extent();
  const double touching = kTouchingDistance * std::max({extent.x, extent.y, extent.z});
  const uint64_t ray_key = hash_combine(key, static_cast<uint64_t>(DimensionSet::probe_pilot));
  uint32_t hits = 0, backs = 0, touches = 0;
  double sum = 0, least = INFINITY;
  for (uint32_t i = 0; i < kSurroundingRays; ++i) {
    const Ray ray{origin, uniform_direction(sobol2(ray_key, i))};
    ++counters.nearest_rays;
    const Hit hit = tracer.nearest(ray, counters);
    if (!hit.hit()) continue;
    ++hits;
    const double t = static_cast<double>(hit.t);
    sum += t;
    least = std::min(least, t);
    if (t < touching) ++touches;
    const SurfaceMesh& mesh = scene.meshes[hit.mesh];
    const bool single_sided = !scene.materials[static_cast<size_t>(mesh.material)].double_sided;
    if (single_sided && dot(surface_point(scene, hit).normal, ray.direction) > 0) ++backs;
  }
  ProbeSurroundings found;
  if (hits == 0) return found;
  const double unit = 1 / scene.normalisation.scale();
  found.backface_share = static_cast<double>(backs) / hits;
  found.hit_share = static_cast<double>(hits) / kSurroundingRays;
  found.distance_mean = sum / hits * unit;
  found.distance_min = least * unit;
  if (touches > kTouchingShare * kSurroundingRays) {
    found.status = ProbeStatus::on_surface;
  } else if (found.backface_share > kInsideShare) {
    found.status = ProbeStatus::inside_geometry;
  }
  return found;
}

std::vector<float> probe_distances(const Tracer& tracer, const Vec3& origin, int size,
                                   RayCounters& counters) {
  const double unit = 1 / tracer.scene().normalisation.scale();
  std::vector<float> distances;
  distances.reserve(static_cast<size_t>(6 * size * size));
  for (int face = 0; face < 6; ++face) {
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const Vec3 direction = to_float(cube_texel_direction(face, x, y, size));
        ++counters.nearest_rays;
        const Hit hit = tracer.nearest({origin, direction}, counters);
        distances.push_back(hit.hit() ? static_cast<float>(static_cast<double>(hit.t) * unit)
                                      : 0.0f);
      }
    }
  }
  return distances;
}

}  // namespace lightkiln
