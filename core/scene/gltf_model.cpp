// tinygltf's own loader is not safe on hostile files: it copies the binary chunk once a buffer,
// opens any path, recurses over "extras" and never checks a range. So it is given a document that
// has passed every check, cut down to what it can do no harm with.

#include "core/scene/gltf_model.h"

#include <algorithm>
#include <fstream>  // tinygltf uses it without including it

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunused-function"
#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_FS
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

#include "core/base/error.h"
#include "core/scene/gltf_formats.h"

namespace lightkiln {

namespace {

// --- The document that tinygltf sees -------------------------------------------------------------

bool is_read_extension(const std::string& name) {
  return name == "KHR_texture_transform" || name == "KHR_materials_unlit" ||
         name == "KHR_materials_emissive_strength" || name == "KHR_lights_punctual" ||
         name == "KHR_draco_mesh_compression";
}

// A copy without "extras" and without extensions that are not read. The nesting was bounded when
// the JSON was parsed.
JsonValue trimmed(const JsonValue& value) {
  if (const JsonArray* items = value.array()) {
    JsonArray copy;
    for (const JsonValue& item : *items) copy.push_back(trimmed(item));
    return {std::move(copy)};
  }
  if (const JsonObject* members = value.object()) {
    JsonValue copy{JsonObject{}};
    for (const JsonMember& member : *members) {
      if (member.key == "extras") continue;
      if (member.key == "extensions" && member.value.object()) {
        JsonValue kept{JsonObject{}};
        for (const JsonMember& extension : *member.value.object()) {
          if (is_read_extension(extension.key)) kept.set(extension.key, trimmed(extension.value));
        }
        copy.set(member.key, std::move(kept));
      } else {
        copy.object()->push_back({member.key, trimmed(member.value)});
      }
    }
    return copy;
  }
  return value;
}

// Accessors are reduced to placeholders, because tinygltf only needs to see that indices exist.
std::string harmless_text(const JsonValue& root) {
  JsonValue copy{JsonObject{}};
  for (const char* name : {"asset", "scene", "scenes", "nodes", "meshes", "materials", "textures",
                           "samplers", "skins", "extensions"}) {
    if (const JsonValue* section = root.find(name)) copy.set(name, *section);
  }
  copy = trimmed(copy);
  JsonValue view{JsonObject{}}, accessor{JsonObject{}};
  view.set("buffer", json_number(0));
  view.set("byteLength", json_number(1));
  accessor.set("bufferView", json_number(0));
  accessor.set("componentType", json_number(5121));
  accessor.set("count", json_number(1));
  accessor.set("type", json_string("SCALAR"));
  copy.set("bufferViews", {JsonArray{view}});
  copy.set("accessors", {JsonArray(section_size(root, "accessors"), accessor)});
  return to_text(copy);
}

tinygltf::Model parse(const JsonValue& root) {
  const std::string text = harmless_text(root);
  tinygltf::Model model;
  std::string error, warning;
  bool loaded = false;
  try {
    tinygltf::TinyGLTF loader;
    loaded = loader.LoadASCIIFromString(&model, &error, &warning, text.data(),
                                        static_cast<unsigned int>(text.size()), "/nowhere",
                                        tinygltf::NO_REQUIRE);
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!loaded) {
    throw Error(ErrorCode::invalid_input, "The glTF cannot be read: " + error.substr(0, 200));
  }
  return model;
}

// --- From tinygltf's structs to ours -------------------------------------------------------------

AttributeMap attribute_map(const std::map<std::string, int>& from) {
  AttributeMap to;
  for (const auto& [name, accessor] : from) to[name] = static_cast<size_t>(accessor);
  return to;
}

GltfPrimitive primitive(const tinygltf::Primitive& from) {
  GltfPrimitive to;
  to.mode = static_cast<PrimitiveMode>(from.mode);
  to.attributes = attribute_map(from.attributes);
  for (const auto& target : from.targets) to.targets.push_back(attribute_map(target));
  if (from.indices >= 0) to.indices = static_cast<size_t>(from.indices);
  to.material = from.material;
  const auto extension = from.extensions.find("KHR_draco_mesh_compression");
  if (extension != from.extensions.end()) {
    GltfDraco draco;
    draco.view = static_cast<size_t>(extension->second.Get("bufferView").GetNumberAsInt());
    const tinygltf::Value& ids = extension->second.Get("attributes");
    for (const std::string& name : ids.Keys()) {
      draco.unique_ids[name] = static_cast<uint32_t>(ids.Get(name).GetNumberAsInt());
    }
    to.draco = std::move(draco);
  }
  return to;
}

GltfMesh mesh(const tinygltf::Mesh& from) {
  GltfMesh to;
  to.name = from.name;
  to.weights = from.weights;
  for (const auto& p : from.primitives) to.primitives.push_back(primitive(p));
  return to;
}

// Rotation matrix of the unit quaternion (x, y, z, w), columns scaled; glTF 2.0, section 3.5.3:
// M = T R S.
Affine from_trs(const tinygltf::Node& node, const std::string& where) {
  Affine map;
  const auto& q = node.rotation;
  double x = 0, y = 0, z = 0, w = 1;
  if (q.size() == 4) {
    const double size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(size > 0 && std::isfinite(size))) {
      throw Error(ErrorCode::invalid_input, "A node's rotation must be a quaternion of length 1.",
                  where + "/rotation");
    }
    x = q[0] / size, y = q[1] / size, z = q[2] / size, w = q[3] / size;
  }
  const double rotation[3][3] = {
      {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
      {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
      {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      map.linear[row][column] =
          rotation[row][column] * (node.scale.size() == 3 ? node.scale[column] : 1);
    }
  }
  if (node.translation.size() == 3) {
    map.translation = {node.translation[0], node.translation[1], node.translation[2]};
  }
  return map;
}

Affine local_transform(const tinygltf::Node& node, const JsonValue& json, size_t index) {
  const std::string where = "/nodes/" + std::to_string(index);
  if (node.matrix.size() != 16) return from_trs(node, where);
  if (json.find("translation") || json.find("rotation") || json.find("scale")) {
    throw Error(ErrorCode::invalid_input,
                "A node must have either a matrix or translation, rotation and scale, not both.",
                where + "/matrix");
  }
  const auto& m = node.matrix;  // column-major
  if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1) {
    throw Error(ErrorCode::invalid_input, "A node's matrix must end in the row 0, 0, 0, 1.",
                where + "/matrix");
  }
  Affine map;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) map.linear[row][column] = m[column * 4 + row];
  }
  map.translation = {m[12], m[13], m[14]};
  return map;
}

GltfNode node(const tinygltf::Node& from, const JsonValue& json, size_t index) {
  GltfNode to;
  to.name = from.name;
  to.mesh = from.mesh;
  to.skin = from.skin;
  for (const int child : from.children) to.children.push_back(static_cast<size_t>(child));
  to.weights = from.weights;
  to.local = local_transform(from, json, index);
  const auto light = from.extensions.find("KHR_lights_punctual");
  if (light != from.extensions.end()) to.light = light->second.Get("light").GetNumberAsInt();
  return to;
}

GltfSkin skin(const tinygltf::Skin& from) {
  GltfSkin to;
  for (const int joint : from.joints) to.joints.push_back(static_cast<size_t>(joint));
  if (from.inverseBindMatrices >= 0)
    to.inverse_bind = static_cast<size_t>(from.inverseBindMatrices);
  return to;
}

WrapMode wrap_mode(int code) {
  if (code == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return WrapMode::clamp;
  if (code == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return WrapMode::mirrored_repeat;
  return WrapMode::repeat;
}

GltfTexture texture(const tinygltf::Texture& from, const tinygltf::Model& model) {
  GltfTexture to;
  to.name = from.name;
  to.image = from.source;
  if (from.sampler >= 0) {
    const tinygltf::Sampler& sampler = model.samplers[static_cast<size_t>(from.sampler)];
    to.wrap_s = wrap_mode(sampler.wrapS);
    to.wrap_t = wrap_mode(sampler.wrapT);
    to.nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
  }
  return to;
}

Vec2 pair(const tinygltf::Value& value, Vec2 fallback) {
  if (value.ArrayLen() != 2) return fallback;
  return {static_cast<float>(value.Get(0).GetNumberAsDouble()),
          static_cast<float>(value.Get(1).GetNumberAsDouble())};
}

TextureSlot slot(const tinygltf::TextureInfo& from, const std::string& where,
                 std::vector<std::string>& warnings) {
  TextureSlot to;
  to.texture = from.index;
  to.texcoord = from.texCoord;
  const auto extension = from.extensions.find("KHR_texture_transform");
  if (extension != from.extensions.end()) {
    const tinygltf::Value& transform = extension->second;
    if (transform.Has("offset")) to.offset = pair(transform.Get("offset"), to.offset);
    if (transform.Has("scale")) to.scale = pair(transform.Get("scale"), to.scale);
    if (transform.Has("rotation")) {
      to.rotation_rad = static_cast<float>(transform.Get("rotation").GetNumberAsDouble());
    }
    if (transform.Has("texCoord")) to.texcoord = transform.Get("texCoord").GetNumberAsInt();
  }
  if (to.texture >= 0 && to.texcoord > 1) {
    warnings.push_back("The texture at " + where + " is ignored: it reads TEXCOORD_" +
                       std::to_string(to.texcoord) + ", and only sets 0 and 1 are read.");
    to.texture = -1;
    to.texcoord = 0;
  }
  return to;
}

Vec3 colour(const std::vector<double>& from, const Vec3& fallback) {
  if (from.size() < 3) return fallback;
  return to_float({from[0], from[1], from[2]});
}

Material material(const tinygltf::Material& from, size_t index,
                  std::vector<std::string>& warnings) {
  const std::string where = "/materials/" + std::to_string(index);
  const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
  Material to;
  to.name = from.name;
  to.base_color = colour(pbr.baseColorFactor, {1, 1, 1});
  for (int c = 0; c < 3; ++c) to.base_color[c] = std::min(to.base_color[c], 1.0f);
  if (pbr.baseColorFactor.size() == 4) to.alpha = static_cast<float>(pbr.baseColorFactor[3]);
  to.base_color_texture =
      slot(pbr.baseColorTexture, where + "/pbrMetallicRoughness/baseColorTexture", warnings);
  to.emissive = colour(from.emissiveFactor, {0, 0, 0});
  to.emissive_texture = slot(from.emissiveTexture, where + "/emissiveTexture", warnings);
  const auto strength = from.extensions.find("KHR_materials_emissive_strength");
  if (strength != from.extensions.end() && strength->second.Has("emissiveStrength")) {
    to.emissive *= static_cast<float>(strength->second.Get("emissiveStrength").GetNumberAsDouble());
  }
  if (from.alphaMode == "MASK") {
    to.alpha_mode = AlphaMode::mask;
  } else if (from.alphaMode == "BLEND") {
    to.alpha_mode = AlphaMode::blend;
  } else if (!from.alphaMode.empty() && from.alphaMode != "OPAQUE") {
    throw Error(ErrorCode::invalid_input, "The alpha mode must be OPAQUE, MASK or BLEND.",
                where + "/alphaMode");
  }
  to.alpha_cutoff = static_cast<float>(from.alphaCutoff);
  to.double_sided = from.doubleSided;
  to.unlit = from.extensions.contains("KHR_materials_unlit");
  to.metallic = static_cast<float>(pbr.metallicFactor);
  to.roughness = static_cast<float>(pbr.roughnessFactor);
  to.has_metallic_roughness_texture = pbr.metallicRoughnessTexture.index >= 0;
  return to;
}

PunctualLight light(const tinygltf::Light& from, size_t index) {
  const std::string where = "/extensions/KHR_lights_punctual/lights/" + std::to_string(index);
  PunctualLight to;
  to.name = from.name;
  if (from.type == "directional") {
    to.kind = LightKind::directional;
  } else if (from.type == "spot") {
    to.kind = LightKind::spot;
    to.inner_cone_rad = from.spot.innerConeAngle;
    to.outer_cone_rad = from.spot.outerConeAngle;
    if (!(to.inner_cone_rad < to.outer_cone_rad)) {
      throw Error(ErrorCode::invalid_input,
                  "A spot light's inner cone angle must be smaller than its outer one.",
                  where + "/spot");
    }
  } else if (from.type != "point") {
    throw Error(ErrorCode::invalid_input,
                "A punctual light's type must be directional, point or spot.", where + "/type");
  }
  to.intensity = colour(from.color, {1, 1, 1}) * static_cast<float>(from.intensity);
  to.range = to.kind == LightKind::directional ? 0 : from.range;
  return to;
}

// glTF 2.0, section 3.5.1: without "scene" nothing needs to be shown; like viewers, the first one
// is. Without any scene the file is a library of parts, and there is nothing to bake.
std::vector<size_t> scene_roots(const tinygltf::Model& model, std::vector<std::string>& warnings) {
  if (model.scenes.empty()) {
    if (!model.nodes.empty()) {
      warnings.push_back("The glTF has nodes but no scene; there is nothing to bake.");
    }
    return {};
  }
  if (model.defaultScene < 0 && model.scenes.size() > 1) {
    warnings.push_back("The glTF names no default scene; the first one is baked.");
  }
  std::vector<size_t> roots;
  for (const int root : model.scenes[static_cast<size_t>(std::max(model.defaultScene, 0))].nodes) {
    roots.push_back(static_cast<size_t>(root));
  }
  return roots;
}

}  // namespace

GltfModel read_model(const GltfFile& file) {
  const tinygltf::Model from = parse(file.json);
  GltfModel to;
  for (const auto& m : from.meshes) to.meshes.push_back(mesh(m));
  for (size_t i = 0; i < from.nodes.size(); ++i) {
    to.nodes.push_back(node(from.nodes[i], (*file.json.find("nodes")->array())[i], i));
  }
  for (const auto& s : from.skins) to.skins.push_back(skin(s));
  for (size_t i = 0; i < from.materials.size(); ++i) {
    to.materials.push_back(material(from.materials[i], i, to.warnings));
  }
  for (const auto& t : from.textures) to.textures.push_back(texture(t, from));
  for (size_t i = 0; i < from.lights.size(); ++i) to.lights.push_back(light(from.lights[i], i));
  to.roots = scene_roots(from, to.warnings);
  check_formats(file, to);
  return to;
}

}  // namespace lightkiln
