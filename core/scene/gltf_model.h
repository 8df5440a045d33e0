#pragma once

// The harmless part of a checked glTF as plain structs: nodes, meshes, skins, materials, textures
// and lights. Read by tinygltf (the only user), which is shown neither buffers nor images: it opens
// no file, copies no data and decodes nothing.

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/gltf_file.h"
#include "core/scene/scene.h"

namespace lightkiln {

using AttributeMap = std::map<std::string, size_t>;  // semantic -> accessor

struct GltfDraco {
  size_t view = 0;
  std::map<std::string, uint32_t> unique_ids;
};

enum class PrimitiveMode { points, lines, line_loop, line_strip, triangles, strip, fan };

struct GltfPrimitive {
  PrimitiveMode mode = PrimitiveMode::triangles;
  AttributeMap attributes;
  std::vector<AttributeMap> targets;
  std::optional<size_t> indices;
  int material = -1;
  std::optional<GltfDraco> draco;
};

struct GltfMesh {
  std::string name;
  std::vector<GltfPrimitive> primitives;
  std::vector<double> weights;
};

struct GltfNode {
  std::string name;
  int mesh = -1, skin = -1, light = -1;
  std::vector<size_t> children;
  std::vector<double> weights;  // empty: the mesh's
  Affine local;
};

struct GltfSkin {
  std::vector<size_t> joints;
  std::optional<size_t> inverse_bind;  // accessor
};

struct GltfTexture {
  std::string name;
  int image = -1;  // -1: none that can be decoded
  WrapMode wrap_s = WrapMode::repeat, wrap_t = WrapMode::repeat;
  bool nearest = false;
};

struct GltfModel {
  std::vector<GltfMesh> meshes;
  std::vector<GltfNode> nodes;
  std::vector<GltfSkin> skins;
  std::vector<Material> materials;  // texture slots hold glTF texture indices
  std::vector<GltfTexture> textures;
  std::vector<PunctualLight> lights;  // not yet placed
  std::vector<size_t> roots;          // of the scene to bake
  std::vector<std::string> warnings;
};

// Throws Error{invalid_input}.
GltfModel read_model(const GltfFile& file);

}  // namespace lightkiln
