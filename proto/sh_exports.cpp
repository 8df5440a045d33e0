// Coefficients as other engines' users load them.

#include <cstdio>
#include <cstring>

#include "proto/json.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

// What an importer must know beside the numbers.
struct TargetWords {
  const char* engine;
  const char* quantity;
  const char* axes;
  const char* use;
};
const TargetWords& words(ShTarget target) {
  static const TargetWords three = {
      "three.js", "radiance coefficients, basis without Condon-Shortley phase",
      "right-handed, +Y up, as glTF",
      "A light probe: new THREE.ObjectLoader().parse(json), or new THREE.LightProbe().sh.fromArray("
      "json.object.sh)."};
  static const TargetWords filament = {
      "Filament", "irradiance / pi, times the constants of the basis",
      "right-handed, +Y up, as glTF",
      "IndirectLight::Builder::irradiance(3, sh); the text form of cmgen."};
  static const TargetWords unity = {
      "Unity", "irradiance / pi, times the constants of the basis",
      "left-handed, +Y up: x is the negative of glTF's x",
      "SphericalHarmonicsL2 sh; sh[channel, i] = coefficients[9 * channel + i]; then "
      "RenderSettings.ambientProbe or LightProbes.bakedProbes."};
  static const TargetWords unreal = {
      "Unreal Engine", "radiance coefficients, basis with Condon-Shortley phase",
      "left-handed, +Z up: (x, z, y) of glTF",
      "FSHVectorRGB3 of C++ (R.V, G.V, B.V), as FSkyLightSceneProxy::IrradianceEnvironmentMap "
      "holds "
      "it; sky_irradiance_environment_map is the packed form that shaders read. The editor imports "
      "no coefficients."};
  static const TargetWords babylon = {
      "Babylon.js", "irradiance / pi, basis with Condon-Shortley phase",
      "left-handed, +Y up: x is the negative of glTF's x",
      "texture.sphericalPolynomial = "
      "SphericalPolynomial.FromHarmonics(SphericalHarmonics.FromArray("
      "sphericalHarmonics)); `irradiance` is the member of that name in the header of .env files."};
  static const TargetWords godot = {
      "Godot 4", "radiance coefficients / pi, basis without Condon-Shortley phase",
      "right-handed, +Y up, as glTF",
      "point_sh of RenderingServer.lightmap_set_probe_capture_data, nine Colors a probe, as "
      "LightmapGI bakes them. Skies take no coefficients."};
  static const TargetWords ext = {
      "glTF EXT_lights_image_based", "irradiance coefficients, basis with Condon-Shortley phase",
      "of the extension's cube map, which is left-handed: x is the negative of glTF's x",
      "irradianceCoefficients of a light. The extension names no convention; this is how "
      "Babylon.js "
      "reads it."};
  switch (target) {
    case ShTarget::three:
      return three;
    case ShTarget::filament:
      return filament;
    case ShTarget::unity:
      return unity;
    case ShTarget::unreal:
      return unreal;
    case ShTarget::babylon:
      return babylon;
    case ShTarget::godot:
      return godot;
    case ShTarget::ext_lights_image_based:
      return ext;
  }
  return three;
}

void write_nine(JsonWriter& writer, const ShExport& sh) {
  writer.begin_array();
  for (const Vec3d& c : sh.coefficients) writer.value(c);
  writer.end_array();
}

void write_channel(JsonWriter& writer, const ShExport& sh, int channel) {
  writer.begin_array();
  for (const Vec3d& c : sh.coefficients) writer.value(c[channel]);
  writer.end_array();
}

// Serialised as three.js serialises a LightProbe.
void write_three(JsonWriter& writer, const ShExport& sh) {
  writer.key("metadata")
      .begin_object()
      .member("version", 4.6)
      .member("type", "Object")
      .member("generator", "lightkiln")
      .end_object()
      .key("object")
      .begin_object()
      .member("uuid", "6c696768-746b-496c-8e00-000000000001")
      .member("type", "LightProbe")
      .member("name", "lightkiln")
      .member("intensity", 1)
      .key("sh")
      .begin_array();
  for (const Vec3d& c : sh.coefficients) {
    for (int channel = 0; channel < 3; ++channel) writer.value(c[channel]);
  }
  writer.end_array().end_object();
}

void write_unity(JsonWriter& writer, const ShExport& sh) {
  writer.key("coefficients").begin_array();
  for (int channel = 0; channel < 3; ++channel) {
    for (const Vec3d& c : sh.coefficients) writer.value(c[channel]);
  }
  writer.end_array();
}

void write_unreal(JsonWriter& writer, const ShExport& sh) {
  for (int channel = 0; channel < 3; ++channel) {
    writer.key(std::string(1, "RGB"[channel]));
    write_channel(writer, sh, channel);
  }
  writer.key("sky_irradiance_environment_map").begin_array();
  for (const auto& row : sh.packed) {
    writer.begin_array();
    for (const double value : row) writer.value(value);
    writer.end_array();
  }
  writer.end_array();
}

void write_babylon(JsonWriter& writer, const ShExport& sh) {
  constexpr const char* kTerms[] = {"x", "y", "z", "xx", "yy", "zz", "yz", "zx", "xy"};
  writer.key("sphericalHarmonics");
  write_nine(writer, sh);
  writer.key("irradiance").begin_object();
  for (size_t i = 0; i < sh.polynomial.size(); ++i) writer.member(kTerms[i], sh.polynomial[i]);
  writer.end_object();
}

void write_godot(JsonWriter& writer, const ShExport& sh) {
  writer.key("point_sh").begin_array();
  for (const Vec3d& c : sh.coefficients) {
    writer.begin_array().value(c.x).value(c.y).value(c.z).value(1).end_array();
  }
  writer.end_array();
}

void write_numbers(JsonWriter& writer, const ShExport& sh) {
  switch (sh.target) {
    case ShTarget::three:
      return write_three(writer, sh);
    case ShTarget::unity:
      return write_unity(writer, sh);
    case ShTarget::unreal:
      return write_unreal(writer, sh);
    case ShTarget::babylon:
      return write_babylon(writer, sh);
    case ShTarget::godot:
      return write_godot(writer, sh);
    case ShTarget::ext_lights_image_based:
      writer.key("irradianceCoefficients");
      return write_nine(writer, sh);
    case ShTarget::filament:
      break;
  }
  throw Error(ErrorCode::internal, "Filament's coefficients are text.");
}

std::string export_json(const ShExport& sh) {
  const TargetWords& about = words(sh.target);
  JsonWriter writer;
  writer.begin_object();
  write_numbers(writer, sh);
  writer.key("lightkiln")
      .begin_object()
      .member("engine", about.engine)
      .member("quantity", about.quantity)
      .member("order", "00 1-1 10 11 2-2 2-1 20 21 22")
      .member("axes", about.axes)
      .member("colour_space", "linear Rec. 709")
      .member("use", about.use)
      .member("selftest_quantity",
              "irradiance / pi at a surface whose normal is given in the engine's axes: what the "
              "engine multiplies by albedo")
      .key("selftest")
      .begin_array();
  for (const auto& [normal, diffuse] : sh.selftest)
    writer.begin_object().member("normal", normal).member("diffuse", diffuse).end_object();
  writer.end_array().end_object().end_object();
  return writer.take();
}

// The nine lines that cmgen writes.
std::string filament_text(const ShExport& sh) {
  constexpr const char* kNames[] = {"L00",  "L1-1", "L10", "L11", "L2-2",
                                    "L2-1", "L20",  "L21", "L22"};
  std::string text;
  for (size_t i = 0; i < sh.coefficients.size(); ++i) {
    const Vec3d& c = sh.coefficients[i];
    char line[512];
    std::snprintf(line, sizeof line,
                  "(%18.15f, %18.15f, %18.15f); // %s, irradiance, pre-scaled base\n", c.x, c.y,
                  c.z, kNames[i]);
    text += line;
  }
  return text;
}

}  // namespace

std::string export_name(ShTarget target) {
  return std::string("sh_") + sh_target_name(target) +
         (target == ShTarget::filament ? ".txt" : ".json");
}

std::vector<Artifact> write_exports(const Assembly& assembly) {
  std::vector<Artifact> files;
  const auto* document = std::get_if<EnvironmentDocument>(&assembly.document);
  if (!document) return files;
  for (const ShExport& sh : document->sh_exports) {
    const bool plain = sh.target == ShTarget::filament;
    const std::string text = plain ? filament_text(sh) : export_json(sh);
    std::vector<std::byte> bytes(text.size());
    std::memcpy(bytes.data(), text.data(), text.size());
    files.push_back({export_name(sh.target), "table", plain ? "text/plain" : "application/json",
                     std::move(bytes)});
  }
  return files;
}

}  // namespace lightkiln
