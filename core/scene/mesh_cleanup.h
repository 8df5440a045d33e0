#pragma once

// Which vertices and triangles of a file can be baked. Nothing is dropped without being counted.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/scene.h"

namespace lightkiln {

// Above this a square overflows single precision, and no ray can be intersected.
inline constexpr double kOversize = 1.844e18;

using Triangle = std::array<uint32_t, 3>;

// Marks vertices that are NaN, infinite (as stored) or beyond kOversize (in world space) and counts
// them in `report`, each under its first fault.
std::vector<bool> find_bad_vertices(std::span<const Vec3> stored, std::span<const Vec3d> world,
                                    SceneReport& report);

// Throws Error{invalid_input} when more than one vertex in a hundred is bad.
void refuse_many_bad_vertices(const SceneReport& report);

// Removes triangles that touch a bad vertex.
void drop_broken(std::vector<Triangle>& triangles, const std::vector<bool>& bad,
                 SceneReport& report);

// Removes triangles without area. Positions are taken as they are: exact in the file's own
// coordinates, where collinear points stay collinear.
void drop_degenerate(std::vector<Triangle>& triangles, std::span<const Vec3> positions,
                     SceneReport& report);
void drop_degenerate(std::vector<Triangle>& triangles, std::span<const Vec3d> positions,
                     SceneReport& report);

// Removes every triangle that has the same corners in the same winding and the same material as an
// earlier one, across all meshes.
void drop_duplicates(std::vector<SurfaceMesh>& meshes, SceneReport& report);

}  // namespace lightkiln
