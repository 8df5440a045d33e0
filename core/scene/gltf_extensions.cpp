// Which extensions a scene may ask for, and what ignoring the others costs.

#include <algorithm>
#include <array>
#include <string_view>

#include "core/base/error.h"
#include "core/scene/gltf_file.h"

namespace lightkiln {

namespace {

constexpr std::array<std::string_view, 8> kRead = {
    "KHR_mesh_quantization",           "KHR_texture_transform",   "KHR_materials_unlit",
    "KHR_materials_emissive_strength", "KHR_lights_punctual",     "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",         "KHR_meshopt_compression",
};

// They shape reflections only, which every bake treats as diffuse.
constexpr std::array<std::string_view, 7> kSpecularOnly = {
    "KHR_materials_specular",   "KHR_materials_ior",        "KHR_materials_clearcoat",
    "KHR_materials_sheen",      "KHR_materials_anisotropy", "KHR_materials_iridescence",
    "KHR_materials_dispersion",
};

template <size_t N>
bool contains(const std::array<std::string_view, N>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string without_it(const std::string& name) {
  if (name == "KHR_materials_transmission" || name == "KHR_materials_volume") {
    return "surfaces are baked as opaque";
  }
  if (name == "KHR_materials_pbrSpecularGlossiness") {
    return "the metallic-roughness properties are used, which the file may have left at their "
           "defaults";
  }
  if (name == "EXT_mesh_gpu_instancing") return "each mesh is baked once, not per instance";
  return "the scene is baked without it";
}

}  // namespace

void check_extensions(GltfFile& file) {
  const JsonAt root(file.json, "");
  if (const auto required = root.find("extensionsRequired")) {
    for (size_t i = 0; i < required->size(); ++i) {
      const JsonAt name = (*required)[i];
      if (!contains(kRead, name.string()) && !contains(kSpecularOnly, name.string())) {
        throw Error(ErrorCode::unsupported,
                    "The glTF requires the extension '" + name.string().substr(0, 120) +
                        "', which is not supported.",
                    name.where());
      }
    }
  }
  if (const auto used = root.find("extensionsUsed")) {
    for (size_t i = 0; i < used->size(); ++i) {
      const std::string& name = (*used)[i].string();
      if (contains(kRead, name)) continue;
      const bool specular = contains(kSpecularOnly, name);
      file.warnings.push_back("The extension '" + name.substr(0, 120) + "' is ignored: " +
                              (specular ? "it only shapes reflections, and surfaces are baked as "
                                          "diffuse."
                                        : without_it(name) + "."));
    }
  }
}

}  // namespace lightkiln
