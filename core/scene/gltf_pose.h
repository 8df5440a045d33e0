#pragma once

// Where nodes and joints stand at rest.

#include <vector>

#include "core/scene/gltf_accessors.h"
#include "core/scene/gltf_model.h"

namespace lightkiln {

// first, then second: result.point(p) = second.point(first.point(p)).
Affine composed(const Affine& second, const Affine& first);
double determinant(const Affine& map);
// |det| < 1e-30 |M|^3: the map flattens space, and normals have no image.
bool is_singular(const Affine& map);
// Unit normal of the mapped surface, facing the mapped outside; zero when the map is singular.
Vec3d transformed_normal(const Affine& map, const Vec3d& normal);

// Local to world for every node, also outside the scene (joints may be).
std::vector<Affine> world_transforms(const GltfModel& model);

// The nodes of the scene to bake, depth first in the file's order.
std::vector<size_t> scene_nodes(const GltfModel& model);

// For each joint: bind space to world, world(joint) * inverse bind matrix.
std::vector<Affine> joint_transforms(const GltfModel& model, size_t skin,
                                     const std::vector<Affine>& world,
                                     const AccessorSource& source);

}  // namespace lightkiln
