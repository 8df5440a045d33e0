// Source: Khronos, glTF 2.0 Specification, section 3.7.2 (geometry).

#include "core/scene/gltf_primitive.h"

#include "core/base/error.h"

namespace lightkiln {

namespace {

[[noreturn]] void refuse(const std::string& sentence, const std::string& where) {
  throw Error(ErrorCode::invalid_input, sentence, where);
}

// --- Attributes
// --------------------------------------------------------------------------------------

// Formats and counts were checked with the model.
class Attributes {
 public:
  Attributes(const AccessorSource& source, const AttributeMap& map) : source_(source), map_(map) {}

  bool has(const std::string& name) const { return map_.contains(name); }

  std::vector<Vec3> triples(const std::string& name) const {
    const std::vector<float> values = read_floats(source_, map_.at(name));
    std::vector<Vec3> result(values.size() / 3);
    for (size_t i = 0; i < result.size(); ++i) {
      result[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
    }
    return result;
  }

  std::vector<Vec2> pairs(const std::string& name) const {
    const std::vector<float> values = read_floats(source_, map_.at(name));
    std::vector<Vec2> result(values.size() / 2);
    for (size_t i = 0; i < result.size(); ++i) result[i] = {values[2 * i], values[2 * i + 1]};
    return result;
  }

  std::vector<std::array<float, 4>> colors(const std::string& name) const {
    const size_t rows = source_.file.accessors[map_.at(name)].rows;
    const std::vector<float> values = read_floats(source_, map_.at(name));
    std::vector<std::array<float, 4>> result(values.size() / rows);
    for (size_t i = 0; i < result.size(); ++i) {
      const float* v = &values[rows * i];
      result[i] = {v[0], v[1], v[2], rows == 4 ? v[3] : 1.0f};
    }
    return result;
  }

  std::vector<JointWeights> influences(const std::string& set) const {
    const std::vector<uint32_t> joints = read_unsigned(source_, map_.at("JOINTS_" + set));
    const std::vector<float> weights = read_floats(source_, map_.at("WEIGHTS_" + set));
    std::vector<JointWeights> result(joints.size() / 4);
    for (size_t i = 0; i < result.size(); ++i) {
      for (size_t k = 0; k < 4; ++k) {
        result[i].joints[k] = joints[4 * i + k];
        result[i].weights[k] = weights[4 * i + k];
      }
    }
    return result;
  }

 private:
  const AccessorSource& source_;
  const AttributeMap& map_;
};

// --- Morphs --------------------------------------------------------------------------------------

void add_scaled(std::vector<Vec3>& to, const std::vector<Vec3>& delta, double weight) {
  for (size_t i = 0; i < to.size(); ++i) {
    to[i] = to_float(to_double(to[i]) + to_double(delta[i]) * weight);
  }
}

void morph(PrimitiveData& data, const AccessorSource& source, const GltfPrimitive& primitive,
           const std::vector<double>& weights, const std::string& where) {
  if (!weights.empty() && weights.size() != primitive.targets.size()) {
    refuse("The mesh has " + std::to_string(weights.size()) + " morph weights, but the primitive " +
               std::to_string(primitive.targets.size()) + " targets.",
           where + "/targets");
  }
  for (size_t k = 0; k < primitive.targets.size(); ++k) {
    const Attributes target(source, primitive.targets[k]);
    const double weight = weights.empty() ? 0 : weights[k];
    if (weight == 0) continue;
    data.morphed = true;
    if (target.has("POSITION")) add_scaled(data.positions, target.triples("POSITION"), weight);
    if (target.has("NORMAL") && !data.normals.empty()) {
      add_scaled(data.normals, target.triples("NORMAL"), weight);
    }
  }
}

// --- Triangles -----------------------------------------------------------------------------------

std::vector<uint32_t> read_indices(const AccessorSource& source, size_t accessor, size_t vertices,
                                   const LoadBudget& budget) {
  const std::string place = "/accessors/" + std::to_string(accessor);
  const GltfAccessor& a = source.file.accessors[accessor];
  if (a.count > budget.triangles * 3 + 2) {
    throw Error(ErrorCode::too_large, "The scene has more triangles than allowed.", place);
  }
  std::vector<uint32_t> indices = read_unsigned(source, accessor);
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] >= vertices) {
      refuse("Index " + std::to_string(indices[i]) + " at position " + std::to_string(i) +
                 " points past the primitive's " + std::to_string(vertices) + " vertices.",
             place);
    }
  }
  return indices;
}

// glTF 2.0, section 3.7.2.1: strips alternate, p_i = {v_i, v_(i+1+i%2), v_(i+2-i%2)}; fans turn
// about the first vertex, p_i = {v_(i+1), v_(i+2), v_0}.
std::vector<std::array<uint32_t, 3>> assemble(PrimitiveMode mode, const std::vector<uint32_t>& v) {
  std::vector<std::array<uint32_t, 3>> triangles;
  if (mode == PrimitiveMode::triangles) {
    triangles.reserve(v.size() / 3);
    for (size_t i = 0; i + 2 < v.size(); i += 3) triangles.push_back({v[i], v[i + 1], v[i + 2]});
    return triangles;
  }
  for (size_t i = 0; i + 2 < v.size(); ++i) {
    if (mode == PrimitiveMode::strip) {
      triangles.push_back({v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]});
    } else {
      triangles.push_back({v[i + 1], v[i + 2], v[0]});
    }
  }
  return triangles;
}

void read_triangles(PrimitiveData& data, const AccessorSource& source,
                    const GltfPrimitive& primitive, const std::string& where, LoadBudget& budget) {
  std::vector<uint32_t> corners;
  if (primitive.indices) {
    corners = read_indices(source, *primitive.indices, data.positions.size(), budget);
  } else {
    corners.resize(data.positions.size());
    for (size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<uint32_t>(i);
  }
  if (primitive.mode == PrimitiveMode::triangles && corners.size() % 3 != 0) {
    data.warnings.push_back("The primitive at " + where + " has " + std::to_string(corners.size()) +
                            " corners, no multiple of three; the last ones are ignored.");
  }
  data.triangles = assemble(primitive.mode, corners);
  if (data.triangles.size() > budget.triangles) {
    throw Error(ErrorCode::too_large, "The scene has more triangles than allowed.", where);
  }
  budget.triangles -= data.triangles.size();
}

}  // namespace

bool makes_triangles(PrimitiveMode mode) {
  return mode == PrimitiveMode::triangles || mode == PrimitiveMode::strip ||
         mode == PrimitiveMode::fan;
}

DecodedAccessors decode_primitive(const GltfFile& file, GltfBytes& bytes,
                                  const GltfPrimitive& primitive, const std::string& where) {
  const std::string place = where + "/extensions/KHR_draco_mesh_compression";
  if (primitive.mode != PrimitiveMode::triangles) {
    throw Error(ErrorCode::unsupported, "Draco compression is read for triangle lists only.",
                place);
  }
  if (!primitive.indices) refuse("A Draco-compressed primitive must have indices.", where);
  std::vector<DracoRequest> requests;
  for (const auto& [name, id] : primitive.draco->unique_ids) {
    const auto attribute = primitive.attributes.find(name);
    if (attribute == primitive.attributes.end()) {
      refuse("The Draco extension names an attribute that its primitive lacks.", place);
    }
    requests.push_back({attribute->second, id});
  }
  return decode_draco(file, bytes.view(primitive.draco->view), requests, *primitive.indices, place);
}

PrimitiveData read_primitive(const AccessorSource& source, const GltfPrimitive& primitive,
                             const std::vector<double>& weights, const std::string& where,
                             LoadBudget& budget) {
  const uint64_t count = source.file.accessors[primitive.attributes.at("POSITION")].count;
  if (count > budget.vertices) {
    throw Error(ErrorCode::too_large, "The scene has more vertices than allowed.", where);
  }
  budget.vertices -= count;
  const Attributes attributes(source, primitive.attributes);
  PrimitiveData data;
  data.positions = attributes.triples("POSITION");
  if (attributes.has("NORMAL")) data.normals = attributes.triples("NORMAL");
  for (size_t set = 0; set < 2; ++set) {
    const std::string name = "TEXCOORD_" + std::to_string(set);
    if (attributes.has(name)) data.texcoords[set] = attributes.pairs(name);
  }
  if (attributes.has("COLOR_0")) data.colors = attributes.colors("COLOR_0");
  for (size_t set = 0; attributes.has("JOINTS_" + std::to_string(set)) &&
                       attributes.has("WEIGHTS_" + std::to_string(set));
       ++set) {
    data.influences.push_back(attributes.influences(std::to_string(set)));
  }
  morph(data, source, primitive, weights, where);
  read_triangles(data, source, primitive, where, budget);
  return data;
}

}  // namespace lightkiln
