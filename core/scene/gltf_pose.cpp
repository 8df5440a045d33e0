// Source: Khronos, glTF 2.0 Specification, sections 3.5.3 (transforms) and 3.7.3 (skins).

#include "core/scene/gltf_pose.h"

#include <algorithm>

namespace lightkiln {

Affine composed(const Affine& second, const Affine& first) {
  Affine map;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      map.linear[row][column] = 0;
      for (int k = 0; k < 3; ++k) {
        map.linear[row][column] += second.linear[row][k] * first.linear[k][column];
      }
    }
  }
  map.translation = second.point(first.translation);
  return map;
}

static Vec3d column(const Affine& map, int index) {
  return {map.linear[0][index], map.linear[1][index], map.linear[2][index]};
}

double determinant(const Affine& map) {
  return dot(column(map, 0), cross(column(map, 1), column(map, 2)));
}

bool is_singular(const Affine& map) {
  double norm = 0;
  for (const auto& row : map.linear) {
    for (const double value : row) norm = std::max(norm, std::abs(value));
  }
  // Divided one factor at a time, so that norm^3 neither overflows nor underflows.
  const Vec3d x = column(map, 0) / norm, y = column(map, 1) / norm, z = column(map, 2) / norm;
  return !(std::abs(dot(x, cross(y, z))) >= 1e-30);
}

// A normal is the cross product of two tangents, and Mu x Mv = cof(M) (u x v), with columns
// cof(M) = (y x z, z x x, x x y) for M = (x, y, z). A mirroring M turns the winding too, so that
// the outside keeps its side: n' = sign(det M) cof(M) n, normalised.
Vec3d transformed_normal(const Affine& map, const Vec3d& normal) {
  const Vec3d x = column(map, 0), y = column(map, 1), z = column(map, 2);
  const Vec3d turned = cross(y, z) * normal.x + cross(z, x) * normal.y + cross(x, y) * normal.z;
  const double size = length(turned);
  if (!(size > 0 && std::isfinite(size))) return {};
  return turned * ((determinant(map) < 0 ? -1 : 1) / size);
}

// Calls visit(node, parent) in depth-first order below `roots`; a root is its own parent.
template <typename Visit>
static void walk(const GltfModel& model, const std::vector<size_t>& roots, const Visit& visit) {
  std::vector<std::pair<size_t, size_t>> stack;
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) stack.emplace_back(*root, *root);
  while (!stack.empty()) {
    const auto [node, parent] = stack.back();
    stack.pop_back();
    visit(node, parent);
    const auto& children = model.nodes[node].children;
    for (auto child = children.rbegin(); child != children.rend(); ++child) {
      stack.emplace_back(*child, node);
    }
  }
}

std::vector<Affine> world_transforms(const GltfModel& model) {
  std::vector<bool> has_parent(model.nodes.size(), false);
  for (const GltfNode& node : model.nodes) {
    for (const size_t child : node.children) has_parent[child] = true;
  }
  std::vector<size_t> roots;
  for (size_t i = 0; i < model.nodes.size(); ++i) {
    if (!has_parent[i]) roots.push_back(i);
  }
  std::vector<Affine> world(model.nodes.size());
  walk(model, roots, [&](size_t node, size_t parent) {
    const Affine& local = model.nodes[node].local;
    world[node] = node == parent ? local : composed(world[parent], local);
  });
  return world;
}

std::vector<size_t> scene_nodes(const GltfModel& model) {
  std::vector<size_t> order;
  walk(model, model.roots, [&](size_t node, size_t) { order.push_back(node); });
  return order;
}

std::vector<Affine> joint_transforms(const GltfModel& model, size_t skin,
                                     const std::vector<Affine>& world,
                                     const AccessorSource& source) {
  const GltfSkin& from = model.skins[skin];
  std::vector<Affine> joints;
  for (const size_t joint : from.joints) joints.push_back(world[joint]);
  if (!from.inverse_bind) return joints;
  const std::vector<float> values = read_floats(source, *from.inverse_bind);
  for (size_t i = 0; i < joints.size(); ++i) {
    const float* m = &values[i * 16];
    Affine bind;
    for (size_t row = 0; row < 3; ++row) {
      for (size_t k = 0; k < 3; ++k) bind.linear[row][k] = double{m[k * 4 + row]};
    }
    bind.translation = {double{m[12]}, double{m[13]}, double{m[14]}};
    joints[i] = composed(joints[i], bind);
  }
  return joints;
}

}  // namespace lightkiln
