#pragma once

// Geometric normals: the truth about a triangle, whatever the file's shading normals say.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

// Twice the vector area of the triangle (a, b, c), counter-clockwise seen from where it points.
// Zero for a triangle without area.
Vec3d doubled_area(const Vec3d& a, const Vec3d& b, const Vec3d& c);

// One unit normal a position: the mean of the normals of the triangles that meet there, weighted by
// their angle at the vertex, so that it does not depend on how a face was cut into triangles.
// A vertex of no triangle, or one whose faces cancel, gets +Y. Indices must be in range.
std::vector<Vec3> mean_normals(std::span<const Vec3> positions,
                               std::span<const std::array<uint32_t, 3>> triangles);

}  // namespace lightkiln
