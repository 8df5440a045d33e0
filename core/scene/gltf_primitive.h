#pragma once

// One primitive in the file's own coordinates: attributes read, morphed to the default weights,
// and any mode turned into triangles.

#include <array>
#include <string>
#include <vector>

#include "core/scene/gltf_accessors.h"
#include "core/scene/gltf_model.h"

namespace lightkiln {

struct JointWeights {
  std::array<uint32_t, 4> joints{};
  std::array<float, 4> weights{};
};

struct PrimitiveData {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  // empty, or as stored: not yet checked for length
  std::vector<Vec2> texcoords[2];
  std::vector<std::array<float, 4>> colors;
  std::vector<std::vector<JointWeights>> influences;  // sets of four, each one a position
  std::vector<std::array<uint32_t, 3>> triangles;
  bool morphed = false;
  std::vector<std::string> warnings;
};

// What may still be loaded, counted down over the whole file.
struct LoadBudget {
  uint64_t triangles = 0;
  uint64_t vertices = 0;
};

bool makes_triangles(PrimitiveMode mode);

// Decodes the Draco stream of a primitive that has one.
DecodedAccessors decode_primitive(const GltfFile& file, GltfBytes& bytes,
                                  const GltfPrimitive& primitive, const std::string& where);

// `primitive` must make triangles and have a POSITION. `weights` are the morph weights (empty: 0).
// Throws Error at a place below `where` or /accessors: invalid_input, too_large.
PrimitiveData read_primitive(const AccessorSource& source, const GltfPrimitive& primitive,
                             const std::vector<double>& weights, const std::string& where,
                             LoadBudget& budget);

}  // namespace lightkiln
