// Source: Khronos, KHR_lights_punctual: a directional light emits along its node's local -Z; color
// is linear RGB in [0, 1], intensity in lux (lm/m^2).

#include "core/scene/gltf_lights.h"

#include <algorithm>
#include <cmath>

#include "core/scene/gltf_json.h"

namespace lightkiln {

namespace {

constexpr const char* kExtension = "KHR_lights_punctual";

// The shortest rotation that takes +Z to `d`, hence -Z to -d: by the angle between them about
// z x d = (-d.y, d.x, 0), which at d = -Z may be any axis in that plane. Order x, y, z, w.
JsonValue rotation_towards(const Vec3d& d) {
  const double sine = std::hypot(d.x, d.y), half = std::atan2(sine, d.z) / 2;
  const double scale = sine > 0 ? std::sin(half) / sine : 0;
  const double x = sine > 0 ? -d.y * scale : std::sin(half);
  return {JsonArray{json_number(x), json_number(d.x * scale), json_number(0),
                    json_number(std::cos(half))}};
}

JsonValue light_json(const GltfDirectionalLight& light) {
  const Vec3d& e = light.irradiance;
  const double intensity = std::max({e.x, e.y, e.z});
  JsonValue json{JsonObject{}};
  json.set("name", json_string(light.name));
  json.set("type", json_string("directional"));
  json.set("color", {JsonArray{json_number(e.x / intensity), json_number(e.y / intensity),
                               json_number(e.z / intensity)}});
  json.set("intensity", json_number(intensity));
  return json;
}

}  // namespace

std::vector<std::byte> write_gltf_lights(std::span<const GltfDirectionalLight> lights,
                                         const std::string& generator) {
  JsonArray definitions, nodes, roots;
  for (size_t i = 0; i < lights.size(); ++i) {
    definitions.push_back(light_json(lights[i]));
    JsonValue reference{JsonObject{}}, extensions{JsonObject{}}, node{JsonObject{}};
    reference.set("light", json_number(static_cast<double>(i)));
    extensions.set(kExtension, std::move(reference));
    node.set("name", json_string(lights[i].name));
    node.set("rotation", rotation_towards(lights[i].direction));
    node.set("extensions", std::move(extensions));
    nodes.push_back(std::move(node));
    roots.push_back(json_number(static_cast<double>(i)));
  }
  JsonValue asset{JsonObject{}}, scene{JsonObject{}}, root{JsonObject{}};
  asset.set("version", json_string("2.0"));
  asset.set("generator", json_string(generator));
  root.set("asset", std::move(asset));
  if (!lights.empty()) {  // glTF allows no empty arrays
    JsonValue definition{JsonObject{}}, extensions{JsonObject{}};
    definition.set("lights", {std::move(definitions)});
    extensions.set(kExtension, std::move(definition));
    root.set("extensionsUsed", {JsonArray{json_string(kExtension)}});
    root.set("extensions", std::move(extensions));
    root.set("nodes", {std::move(nodes)});
    scene.set("nodes", {std::move(roots)});
  }
  root.set("scene", json_number(0));
  root.set("scenes", {JsonArray{std::move(scene)}});
  const std::string text = to_text(root);
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

}  // namespace lightkiln
