#pragma once

// Where a vertex looks out from: once just inside each triangle that uses it.
//
// A vertex on an edge or corner has no tangent plane of its own, and a ray that starts exactly on
// it may slip through the corner (Embree's robust mode is watertight at edges, not at vertices).
// What a shaded surface shows near the vertex is the openness of the triangles around it, so a
// vertex's value is the mean, weighted by the triangles' angles at the vertex, of the openness a
// short way inside each of them, about that triangle's own normal. On a convex solid that is
// exactly 1; on a floor at the foot of a wall it is the limit, one half.
//
// Files split a vertex where its texture coordinates or its material change. Vertices of equal
// position and equal normal are therefore one: they share their facets and their random stream,
// get the same value bit for bit, and no seam shows.

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/bake/openness.h"
#include "core/scene/scene.h"

namespace lightkiln {

class VertexFacets {
 public:
  // Keeps a reference to `scene`.
  explicit VertexFacets(const Scene& scene);

  // Vertices of all meshes, in Scene::meshes order.
  uint64_t vertices() const { return first_vertex_.back(); }
  // Vertices that no triangle uses, with none of equal place that one does: their openness is 1.
  uint64_t unused_vertices() const { return unused_; }
  // Index of a mesh's first vertex; for mesh = number of meshes, vertices().
  uint64_t first_vertex(size_t mesh) const { return first_vertex_[mesh]; }

  // The first vertex of the same position and normal; names the random stream.
  uint64_t representative(uint64_t vertex) const { return representative_[vertex]; }

  // Appends the vertex's facets, in triangle order, turned to the side of its shading normal.
  void facets(uint64_t vertex, std::vector<Facet>* out) const;

 private:
  const Scene* scene_;
  std::vector<uint64_t> first_vertex_;
  std::vector<uint64_t> first_triangle_;
  std::vector<uint64_t> representative_;
  // The corners at representative v are corners_[begin_[v] .. begin_[v + 1]), each 3 * triangle +
  // corner, with triangles counted over all meshes.
  std::vector<uint64_t> begin_;
  std::vector<uint64_t> corners_;
  uint64_t unused_ = 0;

  size_t mesh_of(uint64_t index, const std::vector<uint64_t>& first) const;
};

// The facet that `corner` (0..2) of a triangle gives; `toward` chooses its side (a zero dot product
// keeps the winding's). False for a triangle without area.
bool make_facet(const SurfaceMesh& mesh, const std::array<uint32_t, 3>& triangle, int corner,
                const Vec3& toward, Facet* facet);

}  // namespace lightkiln
