#include "core/scene/mesh_cleanup.h"

#include <bit>
#include <unordered_set>

#include "core/base/error.h"
#include "core/scene/normals.h"

namespace lightkiln {

std::vector<bool> find_bad_vertices(std::span<const Vec3> stored, std::span<const Vec3d> world,
                                    SceneReport& report) {
  std::vector<bool> bad(stored.size(), false);
  const auto oversize = [](double v) { return !(std::abs(v) <= kOversize); };
  for (size_t i = 0; i < stored.size(); ++i) {
    const Vec3& p = stored[i];
    const Vec3d& w = world[i];
    bad[i] = true;
    if (std::isnan(p.x) || std::isnan(p.y) || std::isnan(p.z)) {
      ++report.dropped_nan_vertices;
    } else if (!is_finite(p)) {
      ++report.dropped_infinite_vertices;
    } else if (oversize(w.x) || oversize(w.y) || oversize(w.z)) {
      ++report.dropped_oversize_vertices;
    } else {
      bad[i] = false;
    }
  }
  return bad;
}

void refuse_many_bad_vertices(const SceneReport& report) {
  const uint64_t bad = report.dropped_nan_vertices + report.dropped_infinite_vertices +
                       report.dropped_oversize_vertices;
  if (bad * 100 <= report.vertices) return;
  throw Error(ErrorCode::invalid_input,
              std::to_string(bad) + " of " + std::to_string(report.vertices) +
                  " vertices are not finite or too large to trace (" +
                  std::to_string(report.dropped_nan_vertices) + " NaN, " +
                  std::to_string(report.dropped_infinite_vertices) + " infinite, " +
                  std::to_string(report.dropped_oversize_vertices) +
                  " oversize); at most one in a hundred may be.");
}

void drop_broken(std::vector<Triangle>& triangles, const std::vector<bool>& bad,
                 SceneReport& report) {
  report.dropped_broken_triangles += std::erase_if(
      triangles, [&](const Triangle& t) { return bad[t[0]] || bad[t[1]] || bad[t[2]]; });
}

// Differences of floats are exact in double wherever their exponents are within 29 of one another,
// and so is each product of two of them: the area of collinear corners comes out as exactly zero.
template <typename T>
static void drop_without_area(std::vector<Triangle>& triangles, std::span<const Vector3<T>> p,
                              SceneReport& report) {
  const auto corner = [&](uint32_t i) {
    return Vec3d{static_cast<double>(p[i].x), static_cast<double>(p[i].y),
                 static_cast<double>(p[i].z)};
  };
  report.dropped_degenerate_triangles += std::erase_if(triangles, [&](const Triangle& t) {
    const Vec3d area = doubled_area(corner(t[0]), corner(t[1]), corner(t[2]));
    return !(dot(area, area) > 0);
  });
}

void drop_degenerate(std::vector<Triangle>& triangles, std::span<const Vec3> positions,
                     SceneReport& report) {
  drop_without_area(triangles, positions, report);
}
void drop_degenerate(std::vector<Triangle>& triangles, std::span<const Vec3d> positions,
                     SceneReport& report) {
  drop_without_area(triangles, positions, report);
}

// --- Duplicates ----------------------------------------------------------------------------------

namespace {

using Corner = std::array<uint32_t, 3>;  // bits of the coordinates

struct Face {
  std::array<Corner, 3> corners;
  int material;
  bool operator==(const Face&) const = default;
};

struct FaceHash {
  size_t operator()(const Face& face) const {
    uint64_t hash = static_cast<uint64_t>(face.material) + 0x9e3779b97f4a7c15u;
    for (const Corner& corner : face.corners) {
      for (const uint32_t bits : corner) {
        hash = (hash ^ bits) * 0xff51afd7ed558ccdu;
        hash ^= hash >> 32;
      }
    }
    return hash;
  }
};

// Adding zero turns -0 into +0, which is the same place.
Corner corner_bits(const Vec3& p) {
  return {std::bit_cast<uint32_t>(p.x + 0.0f), std::bit_cast<uint32_t>(p.y + 0.0f),
          std::bit_cast<uint32_t>(p.z + 0.0f)};
}

// Rotated so that the smallest corner comes first: the winding stays.
Face face_of(const SurfaceMesh& mesh, const Triangle& t) {
  std::array<Corner, 3> c = {corner_bits(mesh.positions[t[0]]), corner_bits(mesh.positions[t[1]]),
                             corner_bits(mesh.positions[t[2]])};
  while (c[1] < c[0] || c[2] < c[0]) c = {c[1], c[2], c[0]};
  return {c, mesh.material};
}

}  // namespace

void drop_duplicates(std::vector<SurfaceMesh>& meshes, SceneReport& report) {
  size_t count = 0;
  for (const SurfaceMesh& mesh : meshes) count += mesh.triangles.size();
  std::unordered_set<Face, FaceHash> seen;
  seen.reserve(count);
  for (SurfaceMesh& mesh : meshes) {
    report.dropped_duplicate_triangles += std::erase_if(
        mesh.triangles, [&](const Triangle& t) { return !seen.insert(face_of(mesh, t)).second; });
  }
}

}  // namespace lightkiln
