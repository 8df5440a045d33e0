// Source: Thuermer and Wuethrich, "Computing Vertex Normals from Polygonal Facets", Journal of
// Graphics Tools 3(1), 1998 (the angle as weight).

#include "core/scene/normals.h"

namespace lightkiln {

Vec3d doubled_area(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return cross(b - a, c - a);
}

// The angle between edges e and f is atan2(|e x f|, e . f), well conditioned for slivers where
// acos is not. The weighted normal of one corner is therefore
//   (e x f) / |e x f| * atan2(|e x f|, e . f).
static Vec3d corner_normal(const Vec3d& at, const Vec3d& next, const Vec3d& previous) {
  const Vec3d e = next - at;
  const Vec3d f = previous - at;
  const Vec3d n = cross(e, f);
  const double area = length(n);
  if (!(area > 0)) return {};
  return n * (std::atan2(area, dot(e, f)) / area);
}

std::vector<Vec3> mean_normals(std::span<const Vec3> positions,
                               std::span<const std::array<uint32_t, 3>> triangles) {
  std::vector<Vec3d> sums(positions.size());
  for (const auto& triangle : triangles) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const uint32_t at = triangle[corner];
      sums[at] +=
          corner_normal(to_double(positions[at]), to_double(positions[triangle[(corner + 1) % 3]]),
                        to_double(positions[triangle[(corner + 2) % 3]]));
    }
  }
  std::vector<Vec3> normals(positions.size());
  for (size_t i = 0; i < sums.size(); ++i) {
    const double size = length(sums[i]);
    // Angles sum to the order of one radian; what is left of opposite faces is rounding.
    normals[i] = size > 1e-9 ? to_float(sums[i] / size) : Vec3{0, 1, 0};
  }
  return normals;
}

}  // namespace lightkiln
