#pragma once

// Rays against a scene. The only user of Embree. No bad ray reaches it: the gate rejects rays that
// are not finite, have a negative start or a component above 1e18, counts them, and reports them as
// misses.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/math.h"
#include "core/scene/scene.h"

namespace lightkiln {

struct TracerOptions {
  bool robust = true;             // watertight at edges; off is about 1.2 times faster and may leak
  bool pin_isa = true;            // the same instruction set everywhere, so that bytes are equal
  int build_threads = 0;          // 0 = one per processor
  uint64_t max_memory_bytes = 0;  // 0 = no limit of our own; otherwise the build ends out_of_memory
  bool alpha_test = true;         // filter callbacks on masked geometry only; false = all opaque
};

struct Ray {
  Vec3 origin;
  // Need not be unit; distances are in units of its length. Components below 1e-18 count as zero,
  // so that a direction of nothing else misses.
  Vec3 direction;
  float t_near = 0;
  float t_far = INFINITY;
};

struct Hit {
  float t = INFINITY;     // INFINITY = miss
  uint32_t mesh = 0;      // index into Scene::meshes
  uint32_t triangle = 0;  // index into SurfaceMesh::triangles
  float u = 0, v = 0;     // barycentric: p = (1-u-v) p0 + u p1 + v p2
  bool hit() const { return t != INFINITY; }
};

// Counts of what was traced, kept by the caller (one a block of work, summed in order), so that
// what an effect mask leaves out can be proved to cost nothing.
struct RayCounters {
  uint64_t occlusion_rays = 0;
  uint64_t nearest_rays = 0;
  uint64_t shadow_rays = 0;
  uint64_t bounce_rays = 0;
  uint64_t rejected_rays = 0;
  uint64_t filter_calls = 0;
  uint64_t texture_reads = 0;
  uint64_t environment_reads = 0;
  uint64_t point_queries = 0;
  // Of environment maps, which trace nothing: texels of the map that were projected to harmonics,
  // and texels of cubes that were convolved or resampled.
  uint64_t projected_texels = 0;
  uint64_t cube_texels = 0;
  RayCounters& operator+=(const RayCounters& other);
};

// Structure of arrays for one packet; lanes with valid[i] == 0 are not traced.
struct alignas(64) RayPacket16 {
  float origin_x[16], origin_y[16], origin_z[16];
  float direction_x[16], direction_y[16], direction_z[16];
  float t_near[16];
  float t_far[16];
  int32_t valid[16];  // -1 = trace, 0 = leave
};

// The half-space above a plane: points p with dot(normal, p - point) > 0.
struct HalfSpace {
  Vec3 point;
  Vec3 normal;
};

class Tracer {
 public:
  // Keeps a reference to `scene`. Throws Error{out_of_memory, too_large}.
  Tracer(const Scene& scene, const TracerOptions& options);
  ~Tracer();
  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;

  const Scene& scene() const;
  // The instruction set the device runs, e.g. "avx" (pinned) or "avx2".
  const char* isa() const;

  Hit nearest(const Ray& ray, RayCounters& counters) const;
  bool occluded(const Ray& ray, RayCounters& counters) const;
  // Bit i is set when lane i is occluded. Lanes share a rejection gate with the single-ray calls.
  // The caller counts the rays (occlusion_rays, shadow_rays); rejected_rays is counted here.
  uint32_t occluded16(const RayPacket16& packet, RayCounters& counters) const;
  // Distances to the nearest hit (INFINITY = miss) of every valid lane.
  void nearest16(const RayPacket16& packet, float t_hit[16], RayCounters& counters) const;

  // True when it is certain that no triangle within `radius` of `centre` reaches into any of the
  // half-spaces. False means "perhaps not": bounding boxes stand for triangles at the sphere's rim,
  // and the search gives up after 256 triangles.
  bool surely_clear(const Vec3& centre, float radius, std::span<const HalfSpace> half_spaces,
                    RayCounters& counters) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// A point on a triangle with its geometric normal (unit, by winding) and a bound on its rounding
// error.
struct SurfacePoint {
  Vec3 position;
  Vec3 normal;
  Vec3 error;  // per axis: |computed - exact| <= error
};
SurfacePoint surface_point(const Scene& scene, const Hit& hit);

// An origin for rays that leave the surface on the side of `direction`: moved along the geometric
// normal by the error bound and one ulp outwards on each axis (Pharr, Jakob, Humphreys, "Physically
// Based Rendering", 4th ed., section 6.8.6). A bound, never a constant epsilon.
Vec3 offset_origin(const SurfacePoint& point, const Vec3& direction);

}  // namespace lightkiln
