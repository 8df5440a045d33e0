#include "tests/support/gltf_builder.h"

#include <cstdio>
#include <cstring>
#include <type_traits>

#include "core/scene/normals.h"

namespace lightkiln::test {

// --- GLB -----------------------------------------------------------------------------------------

namespace {

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::string triple(const Vec3& v) {
  return "[" + number(v.x) + "," + number(v.y) + "," + number(v.z) + "]";
}

void append_element(std::string& list, const std::string& element) {
  if (!list.empty()) list += ',';
  list += element;
}

std::string section(const std::string& name, const std::string& elements) {
  return elements.empty() ? "" : ",\"" + name + "\":[" + elements + "]";
}

class Glb {
 public:
  // Returns the index of the new accessor.
  template <typename T>
  int accessor(const std::vector<T>& values, int component_type, const char* type,
               const std::string& extra = "") {
    view(std::as_bytes(std::span(values)));
    const size_t count =
        std::is_same_v<T, std::array<uint32_t, 3>> ? values.size() * 3 : values.size();
    append_element(accessors_, "{\"bufferView\":" + std::to_string(views_ - 1) +
                                   ",\"componentType\":" + std::to_string(component_type) +
                                   ",\"count\":" + std::to_string(count) + ",\"type\":\"" + type +
                                   "\"" + extra + "}");
    return accessor_count_++;
  }

  int view(std::span<const std::byte> bytes) {
    while (bin_.size() % 4 != 0) bin_.push_back(std::byte{0});
    append_element(buffer_views_, "{\"buffer\":0,\"byteOffset\":" + std::to_string(bin_.size()) +
                                      ",\"byteLength\":" + std::to_string(bytes.size()) + "}");
    bin_.insert(bin_.end(), bytes.begin(), bytes.end());
    return views_++;
  }

  void part(const Part& part) {
    const MeshData& mesh = part.mesh;
    Bounds box;
    for (const Vec3& p : mesh.positions) grow(box, to_double(p));
    std::string attributes =
        "\"POSITION\":" +
        std::to_string(accessor(mesh.positions, 5126, "VEC3",
                                is_finite(box.lower) && is_finite(box.upper)
                                    ? ",\"min\":" + triple(to_float(box.lower)) +
                                          ",\"max\":" + triple(to_float(box.upper))
                                    : ""));
    const auto attribute = [&](const char* name, const auto& values, const char* type) {
      if (values.empty()) return;
      attributes +=
          std::string(",\"") + name + "\":" + std::to_string(accessor(values, 5126, type));
    };
    attribute("NORMAL", mesh.normals, "VEC3");
    attribute("TEXCOORD_0", mesh.texcoords, "VEC2");
    attribute("COLOR_0", mesh.colors, "VEC4");
    const int indices = accessor(mesh.triangles, 5125, "SCALAR");
    append_element(meshes_, "{\"primitives\":[{\"attributes\":{" + attributes +
                                "},\"indices\":" + std::to_string(indices) +
                                ",\"material\":" + std::to_string(part_count_) + "}]}");
    append_element(materials_, material(part.material));
    std::string node = "\"mesh\":" + std::to_string(part_count_);
    if (part.matrix) {
      std::string values;
      for (double value : *part.matrix) append_element(values, number(value));
      node += ",\"matrix\":[" + values + "]";
    }
    add_node("{" + node + "}");
    ++part_count_;
  }

  void light(const PunctualLight& light) {
    const char* kinds[] = {"directional", "point", "spot"};
    std::string text = std::string("{\"type\":\"") + kinds[static_cast<int>(light.kind)] +
                       "\",\"intensity\":1,\"color\":" + triple(light.intensity);
    if (light.range > 0) text += ",\"range\":" + number(light.range);
    if (light.kind == LightKind::spot) {
      text += ",\"spot\":{\"innerConeAngle\":" + number(light.inner_cone_rad) +
              ",\"outerConeAngle\":" + number(light.outer_cone_rad) + "}";
    }
    append_element(lights_, text + "}");
    add_node("{" + placement(light) + ",\"extensions\":{\"KHR_lights_punctual\":{\"light\":" +
             std::to_string(light_count_++) + "}}}");
  }

  void image(const std::vector<std::byte>& encoded) {
    const bool png = encoded.size() > 1 && encoded[1] == std::byte{'P'};
    append_element(images_, "{\"bufferView\":" + std::to_string(view(encoded)) +
                                ",\"mimeType\":\"image/" + (png ? "png" : "jpeg") + "\"}");
    append_element(textures_, "{\"source\":" + std::to_string(image_count_++) + "}");
  }

  std::vector<std::byte> finish() const {
    std::string json = "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{" +
                       (roots_.empty() ? "" : "\"nodes\":[" + roots_ + "]") + "}]" +
                       section("nodes", nodes_) + section("meshes", meshes_) +
                       section("materials", materials_) + section("accessors", accessors_) +
                       section("bufferViews", buffer_views_) + section("images", images_) +
                       section("textures", textures_);
    if (!bin_.empty())
      json += ",\"buffers\":[{\"byteLength\":" + std::to_string(bin_.size()) + "}]";
    if (!used_.empty()) json += section("extensionsUsed", used_);
    if (!lights_.empty()) {
      json += ",\"extensions\":{\"KHR_lights_punctual\":{\"lights\":[" + lights_ + "]}}";
    }
    return make_glb_container(json + "}", bin_);
  }

  void use(const char* extension) {
    const std::string quoted = std::string("\"") + extension + "\"";
    if (used_.find(quoted) == std::string::npos) append_element(used_, quoted);
  }

 private:
  void add_node(const std::string& node) {
    append_element(nodes_, node);
    append_element(roots_, std::to_string(node_count_++));
  }

  // A light points along its node's -Z; the rotation is the shortest one from there.
  static std::string placement(const PunctualLight& light) {
    const Vec3d d = light.direction;
    double x = d.y, y = -d.x, w = 1 - d.z;  // (-Z x d) and 1 + (-Z . d)
    if (length(d) == 0) x = y = 0, w = 1;
    if (w < 1e-9) x = 0, y = 1, w = 0;
    const double size = std::sqrt(x * x + y * y + w * w);
    return "\"translation\":" + triple(to_float(light.position)) + ",\"rotation\":[" +
           number(x / size) + "," + number(y / size) + ",0," + number(w / size) + "]";
  }

  static std::string slot(const char* name, const TextureSlot& slot) {
    return std::string("\"") + name + "\":{\"index\":" + std::to_string(slot.texture) +
           ",\"texCoord\":" + std::to_string(slot.texcoord) + "}";
  }

  std::string material(const Material& m) {
    std::string pbr = "\"baseColorFactor\":[" + number(m.base_color.x) + "," +
                      number(m.base_color.y) + "," + number(m.base_color.z) + "," +
                      number(m.alpha) + "],\"metallicFactor\":" + number(m.metallic) +
                      ",\"roughnessFactor\":" + number(m.roughness);
    if (m.base_color_texture.texture >= 0) {
      pbr += "," + slot("baseColorTexture", m.base_color_texture);
    }
    std::string text = "{\"pbrMetallicRoughness\":{" + pbr + "}";
    if (m.double_sided) text += ",\"doubleSided\":true";
    if (m.emissive_texture.texture >= 0) text += "," + slot("emissiveTexture", m.emissive_texture);
    if (m.alpha_mode == AlphaMode::blend) text += ",\"alphaMode\":\"BLEND\"";
    if (m.alpha_mode == AlphaMode::mask) {
      text += ",\"alphaMode\":\"MASK\",\"alphaCutoff\":" + number(m.alpha_cutoff);
    }
    std::string extensions;
    const float strength = std::max(m.emissive.x, std::max(m.emissive.y, m.emissive.z));
    const float divisor = strength > 1 ? strength : 1;
    if (strength > 0) text += ",\"emissiveFactor\":" + triple(m.emissive / divisor);
    if (strength > 1) {
      use("KHR_materials_emissive_strength");
      append_element(extensions, "\"KHR_materials_emissive_strength\":{\"emissiveStrength\":" +
                                     number(strength) + "}");
    }
    if (m.unlit) {
      use("KHR_materials_unlit");
      append_element(extensions, "\"KHR_materials_unlit\":{}");
    }
    if (!extensions.empty()) text += ",\"extensions\":{" + extensions + "}";
    return text + "}";
  }

  std::vector<std::byte> bin_;
  std::string accessors_, buffer_views_, meshes_, materials_, nodes_, roots_, lights_, images_,
      textures_, used_;
  int accessor_count_ = 0, views_ = 0, part_count_ = 0, node_count_ = 0, light_count_ = 0,
      image_count_ = 0;
};

void append_u32(std::vector<std::byte>& bytes, size_t value) {
  const auto narrow = static_cast<uint32_t>(value);
  for (int shift = 0; shift < 32; shift += 8) {
    bytes.push_back(static_cast<std::byte>((narrow >> shift) & 0xff));
  }
}

}  // namespace

std::vector<std::byte> make_glb_container(const std::string& json, std::span<const std::byte> bin) {
  const size_t json_size = (json.size() + 3) / 4 * 4;
  const size_t bin_size = (bin.size() + 3) / 4 * 4;
  std::vector<std::byte> bytes;
  append_u32(bytes, 0x46546c67);
  append_u32(bytes, 2);
  append_u32(bytes, 12 + 8 + json_size + (bin.empty() ? 0 : 8 + bin_size));
  append_u32(bytes, json_size);
  append_u32(bytes, 0x4e4f534a);
  for (char c : json) bytes.push_back(static_cast<std::byte>(c));
  bytes.resize(20 + json_size, std::byte{' '});
  if (bin.empty()) return bytes;
  append_u32(bytes, bin_size);
  append_u32(bytes, 0x004e4942);
  bytes.insert(bytes.end(), bin.begin(), bin.end());
  bytes.resize(28 + json_size + bin_size, std::byte{0});
  return bytes;
}

std::vector<std::byte> make_glb(const SceneData& scene) {
  Glb glb;
  for (const Part& part : scene.parts) glb.part(part);
  for (const PunctualLight& light : scene.lights) {
    glb.use("KHR_lights_punctual");
    glb.light(light);
  }
  for (const auto& image : scene.images) glb.image(image);
  return glb.finish();
}

std::vector<std::byte> make_glb(const MeshData& mesh, const Material& material) {
  SceneData scene;
  scene.parts.push_back({mesh, material, {}});
  return make_glb(scene);
}

// --- Scene ---------------------------------------------------------------------------------------

static Affine affine_of(const std::optional<std::array<double, 16>>& matrix) {
  Affine map;
  if (!matrix) return map;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      map.linear[row][column] = (*matrix)[column * 4 + row];
    }
  }
  map.translation = {(*matrix)[12], (*matrix)[13], (*matrix)[14]};
  return map;
}

static SurfaceMesh surface_mesh(const Part& part, int index, const Normalisation& normalisation) {
  const Affine map = affine_of(part.matrix);
  SurfaceMesh mesh;
  mesh.name = "part " + std::to_string(index);
  mesh.node = mesh.mesh = mesh.material = index;
  mesh.primitive = 0;
  for (const Vec3& p : part.mesh.positions) {
    mesh.positions.push_back(to_float(normalisation.to_normalised(map.point(to_double(p)))));
  }
  mesh.texcoords[0] = part.mesh.texcoords;
  mesh.colors = part.mesh.colors;
  mesh.triangles = part.mesh.triangles;
  const Vec3d x = map.vector({1, 0, 0}), y = map.vector({0, 1, 0}), z = map.vector({0, 0, 1});
  const double sign = dot(cross(x, y), z) < 0 ? -1 : 1;
  if (sign < 0) {
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  }
  mesh.normals_from_file = !part.mesh.normals.empty();
  if (mesh.normals_from_file) {
    // The cofactor matrix carries normals: columns y x z, z x x, x x y, times the sign of det.
    for (const Vec3& n : part.mesh.normals) {
      const Vec3d turned =
          cross(y, z) * double(n.x) + cross(z, x) * double(n.y) + cross(x, y) * double(n.z);
      mesh.normals.push_back(to_float(normalize(turned * sign)));
    }
  } else {
    mesh.normals = mean_normals(mesh.positions, mesh.triangles);
  }
  return mesh;
}

Scene make_scene(const SceneData& data) {
  Bounds world;
  for (const Part& part : data.parts) {
    const Affine map = affine_of(part.matrix);
    for (const auto& triangle : part.mesh.triangles) {
      for (uint32_t i : triangle) grow(world, map.point(to_double(part.mesh.positions[i])));
    }
  }
  Scene scene;
  scene.normalisation = make_normalisation(world);
  scene.lights = data.lights;
  scene.textures = data.textures;
  for (const Part& part : data.parts) {
    SurfaceMesh mesh =
        surface_mesh(part, static_cast<int>(scene.meshes.size()), scene.normalisation);
    for (const auto& triangle : mesh.triangles) {
      for (uint32_t i : triangle) grow(scene.bounds, to_double(mesh.positions[i]));
    }
    scene.report.triangles += mesh.triangles.size();
    scene.report.vertices += mesh.positions.size();
    scene.report.meshes_without_normals += mesh.normals_from_file ? 0 : 1;
    scene.materials.push_back(part.material);
    scene.meshes.push_back(std::move(mesh));
  }
  return scene;
}

Scene scene_from_triangles(const MeshData& mesh, const Material& material) {
  SceneData scene;
  scene.parts.push_back({mesh, material, {}});
  return make_scene(scene);
}

}  // namespace lightkiln::test
