#include "core/scene/mesh_topology.h"

#include <algorithm>
#include <unordered_map>

namespace lightkiln {

namespace {

// Cells are four tolerances wide. A point looks into its own cell, and into a neighbour only where
// it lies within one tolerance of the border, which for most points is never.
class Welder {
 public:
  Welder(size_t expected, double tolerance) : tolerance_(tolerance), cell_(4 * tolerance) {
    heads_.reserve(expected);
    points_.reserve(expected);
  }

  uint32_t id(const Vec3& position) {
    const Vec3d p = to_double(position);
    int64_t low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = cell_of(p[axis] - tolerance_);
      high[axis] = cell_of(p[axis] + tolerance_);
    }
    for (int64_t x = low[0]; x <= high[0]; ++x) {
      for (int64_t y = low[1]; y <= high[1]; ++y) {
        for (int64_t z = low[2]; z <= high[2]; ++z) {
          const uint32_t found = search(key(x, y, z), p);
          if (found != kNone) return found;
        }
      }
    }
    const auto added = static_cast<uint32_t>(points_.size());
    uint32_t& head =
        heads_.try_emplace(key(cell_of(p.x), cell_of(p.y), cell_of(p.z)), kNone).first->second;
    points_.push_back({p, head});
    head = added;
    return added;
  }

 private:
  static constexpr uint32_t kNone = 0xffffffff;
  struct Point {
    Vec3d position;
    uint32_t next;  // in the same cell
  };

  int64_t cell_of(double coordinate) const {
    return static_cast<int64_t>(std::floor(coordinate / cell_));
  }
  // 21 bits an axis; coordinates are within [-1, 1] and cells above 1e-6, so no two cells share
  // one.
  static uint64_t key(int64_t x, int64_t y, int64_t z) {
    const auto part = [](int64_t v) { return static_cast<uint64_t>(v + (1 << 20)) & 0x1fffff; };
    return (part(x) << 42) | (part(y) << 21) | part(z);
  }
  uint32_t search(uint64_t cell, const Vec3d& p) const {
    const auto head = heads_.find(cell);
    if (head == heads_.end()) return kNone;
    for (uint32_t i = head->second; i != kNone; i = points_[i].next) {
      const Vec3d d = points_[i].position - p;
      if (std::max(std::abs(d.x), std::max(std::abs(d.y), std::abs(d.z))) <= tolerance_) return i;
    }
    return kNone;
  }

  double tolerance_, cell_;
  std::unordered_map<uint64_t, uint32_t> heads_;
  std::vector<Point> points_;
};

}  // namespace

EdgeCounts count_edges(const std::vector<SurfaceMesh>& meshes, double tolerance) {
  size_t vertices = 0, triangles = 0;
  for (const SurfaceMesh& mesh : meshes) {
    vertices += mesh.positions.size();
    triangles += mesh.triangles.size();
  }
  if (triangles == 0) return {};
  Welder welder(vertices, tolerance);
  // An edge as one number: smaller id, larger id, and whether it runs from small to large. Sorting
  // brings the triangles of an edge together.
  std::vector<uint64_t> edges;
  edges.reserve(triangles * 3);
  for (const SurfaceMesh& mesh : meshes) {
    std::vector<uint32_t> ids(mesh.positions.size(), 0xffffffff);
    for (const auto& t : mesh.triangles) {
      for (const uint32_t i : t) {
        if (ids[i] == 0xffffffff) ids[i] = welder.id(mesh.positions[i]);
      }
      for (size_t k = 0; k < 3; ++k) {
        const uint64_t a = ids[t[k]], b = ids[t[(k + 1) % 3]];
        if (a != b) edges.push_back((std::min(a, b) << 32) | (std::max(a, b) << 1) | (a < b));
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  EdgeCounts counts;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i + 1;
    while (end < edges.size() && (edges[end] >> 1) == (edges[i] >> 1)) ++end;
    if (end - i == 1) ++counts.open;
    if (end - i == 2 && edges[i] == edges[i + 1]) ++counts.inconsistent;
    i = end;
  }
  return counts;
}

}  // namespace lightkiln
