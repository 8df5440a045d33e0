#pragma once

// Whether surfaces are closed and consistently wound, seen by position and not by index.

#include <cstdint>
#include <vector>

#include "core/scene/scene.h"

namespace lightkiln {

struct EdgeCounts {
  uint64_t open = 0;          // edges with one triangle
  uint64_t inconsistent = 0;  // edges whose two triangles run along it the same way
};

// Welds positions that lie within `tolerance` of one another on every axis (for counting only; no
// vertex moves) and counts over all meshes together. A room made of several meshes is closed when
// their borders meet.
EdgeCounts count_edges(const std::vector<SurfaceMesh>& meshes, double tolerance);

}  // namespace lightkiln
