// Source: Khronos Group, EXT_lights_image_based, README and schema.

#include "core/scene/gltf_image_light.h"

#include "core/scene/glb_container.h"
#include "core/scene/gltf_json.h"

namespace lightkiln {

namespace {

constexpr const char* kExtension = "EXT_lights_image_based";

JsonValue object(std::initializer_list<std::pair<const char*, JsonValue>> members) {
  JsonValue value{JsonObject{}};
  for (const auto& [key, member] : members) value.set(key, member);
  return value;
}

JsonValue count(size_t value) {
  return json_number(static_cast<double>(value));
}

}  // namespace

std::vector<std::byte> write_gltf_image_light(const GltfImageLight& light,
                                              const std::string& generator) {
  std::vector<std::byte> bin;
  JsonArray views, images, levels, coefficients;
  for (const auto& faces : light.specular_images) {
    JsonArray level;
    for (const std::vector<std::byte>& face : faces) {
      level.push_back(count(images.size()));
      images.push_back(
          object({{"bufferView", count(views.size())}, {"mimeType", json_string("image/png")}}));
      views.push_back(object({{"buffer", json_number(0)},
                              {"byteOffset", count(bin.size())},
                              {"byteLength", count(face.size())}}));
      bin.insert(bin.end(), face.begin(), face.end());
      bin.resize((bin.size() + 3) / 4 * 4, std::byte{0});
    }
    levels.push_back({std::move(level)});
  }
  for (const Vec3d& c : light.irradiance_coefficients)
    coefficients.push_back({JsonArray{json_number(c.x), json_number(c.y), json_number(c.z)}});

  const JsonValue definition = object({{"name", json_string(light.name)},
                                       {"intensity", json_number(1)},
                                       {"irradianceCoefficients", {std::move(coefficients)}},
                                       {"specularImageSize", json_number(light.size)},
                                       {"specularImages", {std::move(levels)}}});
  const JsonValue scene =
      object({{"name", json_string(light.name)},
              {"extensions", object({{kExtension, object({{"light", json_number(0)}})}})}});
  const JsonValue root = object(
      {{"asset", object({{"version", json_string("2.0")}, {"generator", json_string(generator)}})},
       {"extensionsUsed", {JsonArray{json_string(kExtension)}}},
       {"extensions", object({{kExtension, object({{"lights", {JsonArray{definition}}}})}})},
       {"scene", json_number(0)},
       {"scenes", {JsonArray{scene}}},
       {"images", {std::move(images)}},
       {"bufferViews", {std::move(views)}},
       {"buffers", {JsonArray{object({{"byteLength", count(bin.size())}})}}}});
  return glb_container(to_text(root), bin);
}

}  // namespace lightkiln
