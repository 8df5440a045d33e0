#pragma once

// glTF 2.0 in and out. This floor is the only user of tinygltf, Draco and meshoptimizer. Nothing of
// the file reaches tinygltf before a pre-flight of our own has checked every count, index and byte
// range.

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace lightkiln {

// A GLB, or a .gltf with the files that its URIs name. `resources` is keyed by the URI as
// percent-decoded text, relative and without "..".
struct GltfSource {
  std::span<const std::byte> main;
  std::map<std::string, std::span<const std::byte>> resources;
};

struct GltfLimits {
  uint64_t max_triangles = 20'000'000;
  uint64_t max_json_bytes = 16u << 20;
  uint64_t max_texels = 1u << 28;  // over all textures
};

struct GltfLoadOptions {
  // False leaves every image undecoded: Scene::textures then hold their settings but no pixels and
  // a width of 0. Ambient occlusion needs none unless a material has alpha.
  bool textures = true;
  GltfLimits limits;
};

// Throws Error: invalid_input (malformed, with a JSON pointer in where()), unsupported (a required
// extension, by name), too_large. Skins and morphs are loaded in their rest pose.
Scene load_gltf(const GltfSource& source, const GltfLoadOptions& options);

// A float attribute to add to every written primitive, e.g. "_AO": one value a vertex of every
// SurfaceMesh, concatenated in Scene::meshes order.
struct VertexAttribute {
  std::string name;
  std::span<const float> values;
};

// The source scene as a GLB with the attributes added: materials, textures and node tree kept;
// compressed geometry written plain; a mesh shown by several nodes becomes one mesh a node, since
// each has its own light. `generator` goes into asset.generator. Vertices keep the file's order.
std::vector<std::byte> write_glb(const GltfSource& source, const Scene& scene,
                                 std::span<const VertexAttribute> attributes,
                                 const std::string& generator);

}  // namespace lightkiln
