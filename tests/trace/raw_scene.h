#pragma once

// Scenes whose coordinates reach the tracer as they are, without the loader's normalisation.

#include "core/base/random.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln::test {

inline Scene raw_scene(const MeshData& mesh, const Material& material = {}) {
  Scene scene;
  scene.materials.push_back(material);
  SurfaceMesh surface;
  surface.material = 0;
  surface.positions = mesh.positions;
  surface.normals = mesh.normals;
  surface.texcoords[0] = mesh.texcoords;
  surface.colors = mesh.colors;
  surface.triangles = mesh.triangles;
  scene.meshes.push_back(std::move(surface));
  return scene;
}

// A unit direction, uniform on the sphere, as a function of `index`.
inline Vec3 random_direction(uint64_t index) {
  const uint64_t h = hash64(index);
  const double z = 1 - 2 * (static_cast<double>(h >> 40) + 0.5) * 0x1p-24;
  const double phi = 2 * kPi * static_cast<double>(h & 0xffffff) * 0x1p-24;
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return to_float({r * std::cos(phi), r * std::sin(phi), z});
}

}  // namespace lightkiln::test
