// Points on surfaces and the origins of rays that leave them.

#include <algorithm>
#include <cmath>

#include "core/trace/tracer.h"

namespace lightkiln {

// Barycentric interpolation b0 p0 + b1 p1 + b2 p2 rounds to within gamma(7) times the sum of
// absolute products on each axis, gamma(n) = n e / (1 - n e), e = 2^-24 (Pharr, Jakob, Humphreys,
// "Physically Based Rendering", 4th ed., sections 6.8.4 and 6.8.5). The largest corner coordinate
// takes the sum's place: it is no smaller, and it also bounds what Embree rounds when it moves the
// corners to the ray's origin, which matters where a large triangle passes close to zero.
SurfacePoint surface_point(const Scene& scene, const Hit& hit) {
  constexpr float kGamma7 = 7 * 0x1p-24f / (1 - 7 * 0x1p-24f);
  const SurfaceMesh& mesh = scene.meshes[hit.mesh];
  const auto& corner = mesh.triangles[hit.triangle];
  const Vec3& a = mesh.positions[corner[0]];
  const Vec3& b = mesh.positions[corner[1]];
  const Vec3& c = mesh.positions[corner[2]];
  const float w = 1 - hit.u - hit.v;
  SurfacePoint point;
  for (int axis = 0; axis < 3; ++axis) {
    point.position[axis] = w * a[axis] + hit.u * b[axis] + hit.v * c[axis];
    point.error[axis] =
        kGamma7 * std::max({std::fabs(a[axis]), std::fabs(b[axis]), std::fabs(c[axis])});
  }
  const Vec3d normal = cross(to_double(b) - to_double(a), to_double(c) - to_double(a));
  const double size = length(normal);
  point.normal = size > 0 ? to_float(normal / size) : Vec3{0, 0, 1};
  return point;
}

// A plane through zero, which recentring makes of every flat scene, has no rounding error along its
// normal, and one ulp above zero is flushed back to it: a least distance far below any error of the
// normalised scene, and far above where products underflow, keeps its rays off it.
Vec3 offset_origin(const SurfacePoint& point, const Vec3& direction) {
  constexpr float kLeastDistance = 0x1p-60f;
  const Vec3& n = point.normal;
  const float bound = std::fabs(n.x) * point.error.x + std::fabs(n.y) * point.error.y +
                      std::fabs(n.z) * point.error.z;
  const float distance = std::max(bound, kLeastDistance);
  const Vec3 offset = n * (dot(direction, n) < 0 ? -distance : distance);
  Vec3 moved = point.position + offset;
  for (int axis = 0; axis < 3; ++axis) {
    if (offset[axis] > 0) moved[axis] = std::nextafter(moved[axis], INFINITY);
    if (offset[axis] < 0) moved[axis] = std::nextafter(moved[axis], -INFINITY);
  }
  return moved;
}

}  // namespace lightkiln
