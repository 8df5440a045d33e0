// Source: Khronos, glTF 2.0 Specification, section 3.7.2 (geometry), and KHR_mesh_quantization.

#include "core/scene/gltf_formats.h"

#include "core/base/error.h"

namespace lightkiln {

namespace {

[[noreturn]] void refuse(const std::string& sentence, const std::string& where) {
  throw Error(ErrorCode::invalid_input, sentence, where);
}

bool uses_quantization(const GltfFile& file) {
  const JsonValue* used = file.json.find("extensionsUsed");
  if (!used || !used->array()) return false;
  for (const JsonValue& name : *used->array()) {
    const std::string* text = std::get_if<std::string>(&name.data);
    if (text && *text == "KHR_mesh_quantization") return true;
  }
  return false;
}

bool is_small_integer(ComponentType type) {
  return type != ComponentType::f32 && type != ComponentType::u32;
}

// As a rule over (attribute, accessor, quantised file).
bool attribute_allowed(const std::string& name, const GltfAccessor& a, bool quantized) {
  const bool real = a.component == ComponentType::f32;
  const bool integer = is_small_integer(a.component);
  const bool is_unsigned = a.component == ComponentType::u8 || a.component == ComponentType::u16;
  const bool fraction = real || (is_unsigned && a.normalized);
  if (a.columns != 1) return false;
  if (name == "POSITION") return a.rows == 3 && (real || (quantized && integer));
  if (name == "NORMAL") {
    return a.rows == 3 && (real || (quantized && integer && !is_unsigned && a.normalized));
  }
  if (name.starts_with("TEXCOORD_")) return a.rows == 2 && (fraction || (quantized && integer));
  if (name.starts_with("COLOR_")) return (a.rows == 3 || a.rows == 4) && fraction;
  if (name.starts_with("JOINTS_")) return a.rows == 4 && is_unsigned && !a.normalized;
  if (name.starts_with("WEIGHTS_")) return a.rows == 4 && fraction;
  return true;  // of the file's own making, not read here
}

bool target_allowed(const std::string& name, const GltfAccessor& a, bool quantized) {
  if (name != "POSITION" && name != "NORMAL") return true;
  return a.columns == 1 && a.rows == 3 &&
         (a.component == ComponentType::f32 || (quantized && is_small_integer(a.component)));
}

class Checker {
 public:
  explicit Checker(const GltfFile& file) : file_(file), quantized_(uses_quantization(file)) {}

  void primitive(const GltfPrimitive& p, const std::string& where) const {
    if (p.attributes.empty()) return;
    const auto position = p.attributes.find("POSITION");
    const size_t counted =
        position == p.attributes.end() ? p.attributes.begin()->second : position->second;
    const uint64_t count = file_.accessors[counted].count;
    attributes(p.attributes, count, where + "/attributes", attribute_allowed);
    for (size_t i = 0; i < p.targets.size(); ++i) {
      const std::string place = where + "/targets/" + std::to_string(i);
      attributes(p.targets[i], count, place, target_allowed);
    }
    if (p.attributes.contains("JOINTS_0") && !p.attributes.contains("WEIGHTS_0")) {
      refuse("The primitive has JOINTS_0 but no WEIGHTS_0.", where + "/attributes");
    }
    if (p.indices) indices(*p.indices, where + "/indices");
  }

 private:
  template <typename Allowed>
  void attributes(const AttributeMap& map, uint64_t count, const std::string& where,
                  const Allowed& allowed) const {
    for (const auto& [name, index] : map) {
      const GltfAccessor& accessor = file_.accessors[index];
      if (!allowed(name, accessor, quantized_)) {
        refuse("The accessor's type is not allowed for " + name.substr(0, 80) + ".",
               pointer_below(where, name));
      }
      if (accessor.count != count) {
        refuse("The attribute " + name.substr(0, 80) + " has " + std::to_string(accessor.count) +
                   " elements, but the primitive has " + std::to_string(count) + " vertices.",
               pointer_below(where, name));
      }
    }
  }

  void indices(size_t index, const std::string& where) const {
    const GltfAccessor& a = file_.accessors[index];
    const bool is_unsigned = a.component == ComponentType::u8 ||
                             a.component == ComponentType::u16 || a.component == ComponentType::u32;
    if (a.components() != 1 || a.normalized || !is_unsigned) {
      refuse("Indices must be plain unsigned scalars.", where);
    }
    if (a.view && file_.views[*a.view].stride > component_size(a.component)) {
      refuse("Indices must follow one another without a stride.", where);
    }
  }

  const GltfFile& file_;
  bool quantized_;
};

void check_skin(const GltfFile& file, const GltfSkin& skin, const std::string& where) {
  if (!skin.inverse_bind) return;
  const GltfAccessor& a = file.accessors[*skin.inverse_bind];
  // The slack bounds what is read for one skin; no writer pads its matrices by so much.
  if (a.component != ComponentType::f32 || a.components() != 16 || a.count < skin.joints.size() ||
      a.count > skin.joints.size() + 65536) {
    refuse("The inverse bind matrices must be 4x4 float matrices, one for each joint.",
           where + "/inverseBindMatrices");
  }
}

}  // namespace

void check_formats(const GltfFile& file, const GltfModel& model) {
  const Checker checker(file);
  for (size_t m = 0; m < model.meshes.size(); ++m) {
    const GltfMesh& mesh = model.meshes[m];
    for (size_t p = 0; p < mesh.primitives.size(); ++p) {
      const std::string where = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p);
      checker.primitive(mesh.primitives[p], where);
      if (!mesh.weights.empty() && mesh.weights.size() != mesh.primitives[p].targets.size()) {
        refuse("The mesh has " + std::to_string(mesh.weights.size()) +
                   " morph weights, but the primitive " +
                   std::to_string(mesh.primitives[p].targets.size()) + " targets.",
               where + "/targets");
      }
    }
  }
  for (size_t i = 0; i < model.skins.size(); ++i) {
    check_skin(file, model.skins[i], "/skins/" + std::to_string(i));
  }
}

}  // namespace lightkiln
