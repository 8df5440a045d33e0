// The glTF 2.0 schema as tables: for each object its properties with kind, range and, for an index,
// the section it points into. One walk over the tables checks the whole file, so that what reads it
// afterwards need not. Properties that no bake uses (animations, cameras' lenses) are not listed.
//
// Source: Khronos, glTF 2.0 Specification, chapter 5, and the extensions' own schemas.

#include <algorithm>

#include "core/base/error.h"
#include "core/scene/gltf_file.h"

namespace lightkiln {

namespace {

constexpr uint64_t kMaxCount = uint64_t{1} << 40;
constexpr double kOne = 1 + 1e-6;  // exporters write 1 as the nearest float plus rounding
constexpr double kHuge = 1.7976931348623157e308;

enum class Kind {
  text,
  flag,
  number,
  integer,
  numbers,
  index,
  indices,
  object,
  objects,
  index_map,
  index_maps
};

struct Schema;

struct Property {
  const char* name;
  Kind kind;
  bool required = false;
  const char* section = nullptr;     // index, indices, index_map: what they point into
  double low = 0, high = kMaxCount;  // number, integer, numbers: range
  size_t length = 0;                 // numbers: how many; 0 = any
  const Schema* schema = nullptr;    // object, objects
};

struct Schema {
  std::vector<Property> properties;
};

Property text(const char* name, bool required = false) {
  return {.name = name, .kind = Kind::text, .required = required};
}
Property flag(const char* name) {
  return {.name = name, .kind = Kind::flag};
}
Property number(const char* name, double low, double high) {
  return {.name = name, .kind = Kind::number, .low = low, .high = high};
}
Property integer(const char* name, double low = 0, double high = kMaxCount, bool required = false) {
  return {.name = name, .kind = Kind::integer, .required = required, .low = low, .high = high};
}
Property numbers(const char* name, size_t length, double low = -kHuge, double high = kHuge) {
  return {.name = name, .kind = Kind::numbers, .low = low, .high = high, .length = length};
}
Property index(const char* name, const char* section, bool required = false) {
  return {.name = name, .kind = Kind::index, .required = required, .section = section};
}
Property indices(const char* name, const char* section, bool required = false) {
  return {.name = name, .kind = Kind::indices, .required = required, .section = section};
}
Property index_map(const char* name, const char* section, bool required = false) {
  return {.name = name, .kind = Kind::index_map, .required = required, .section = section};
}
Property index_maps(const char* name, const char* section) {
  return {.name = name, .kind = Kind::index_maps, .section = section};
}
Property object(const char* name, const Schema& schema, bool required = false) {
  return {.name = name, .kind = Kind::object, .required = required, .schema = &schema};
}
Property objects(const char* name, const Schema& schema, bool required = false) {
  return {.name = name, .kind = Kind::objects, .required = required, .schema = &schema};
}

// --- The tables ----------------------------------------------------------------------------------

const Schema kAsset{{text("version", true), text("minVersion"), text("generator")}};

const Schema kBuffer{{text("uri"), integer("byteLength", 1, kMaxCount, true), text("name")}};

const Schema kMeshopt{{index("buffer", "buffers", true), integer("byteOffset"),
                       integer("byteLength", 1, kMaxCount, true),
                       integer("byteStride", 1, 256, true), integer("count", 1, kMaxCount, true),
                       text("mode", true), text("filter")}};
const Schema kViewExtensions{
    {object("EXT_meshopt_compression", kMeshopt), object("KHR_meshopt_compression", kMeshopt)}};
const Schema kView{{index("buffer", "buffers", true), integer("byteOffset"),
                    integer("byteLength", 1, kMaxCount, true), integer("byteStride", 4, 256),
                    text("name"), object("extensions", kViewExtensions)}};

const Schema kSparseIndices{{index("bufferView", "bufferViews", true), integer("byteOffset"),
                             integer("componentType", 5121, 5125, true)}};
const Schema kSparseValues{{index("bufferView", "bufferViews", true), integer("byteOffset")}};
const Schema kSparse{{integer("count", 1, kMaxCount, true), object("indices", kSparseIndices, true),
                      object("values", kSparseValues, true)}};
const Schema kAccessor{{index("bufferView", "bufferViews"), integer("byteOffset"),
                        integer("componentType", 5120, 5126, true), flag("normalized"),
                        integer("count", 1, kMaxCount, true), text("type", true), numbers("max", 0),
                        numbers("min", 0), object("sparse", kSparse), text("name")}};

const Schema kImage{
    {text("uri"), text("mimeType"), index("bufferView", "bufferViews"), text("name")}};
const Schema kSampler{
    {integer("magFilter"), integer("minFilter"), integer("wrapS"), integer("wrapT"), text("name")}};
const Schema kTexture{{index("sampler", "samplers"), index("source", "images"), text("name")}};

const Schema kTextureTransform{{numbers("offset", 2), number("rotation", -kHuge, kHuge),
                                numbers("scale", 2), integer("texCoord", 0, 1e6)}};
const Schema kTextureInfoExtensions{{object("KHR_texture_transform", kTextureTransform)}};
const Schema kTextureInfo{{index("index", "textures", true), integer("texCoord", 0, 1e6),
                           object("extensions", kTextureInfoExtensions)}};
const Schema kMetallicRoughness{
    {numbers("baseColorFactor", 4, 0, kOne), object("baseColorTexture", kTextureInfo),
     number("metallicFactor", 0, kOne), number("roughnessFactor", 0, kOne),
     object("metallicRoughnessTexture", kTextureInfo)}};
const Schema kEmissiveStrength{{number("emissiveStrength", 0, 1e30)}};
const Schema kEmpty{};
const Schema kMaterialExtensions{{object("KHR_materials_emissive_strength", kEmissiveStrength),
                                  object("KHR_materials_unlit", kEmpty)}};
const Schema kMaterial{
    {text("name"), object("pbrMetallicRoughness", kMetallicRoughness),
     object("normalTexture", kTextureInfo), object("occlusionTexture", kTextureInfo),
     object("emissiveTexture", kTextureInfo), numbers("emissiveFactor", 3, 0, 1e30),
     text("alphaMode"), number("alphaCutoff", 0, kHuge), flag("doubleSided"),
     object("extensions", kMaterialExtensions)}};

const Schema kDraco{
    {index("bufferView", "bufferViews", true), index_map("attributes", nullptr, true)}};
const Schema kPrimitiveExtensions{{object("KHR_draco_mesh_compression", kDraco)}};
const Schema kPrimitive{{index_map("attributes", "accessors", true), index("indices", "accessors"),
                         index("material", "materials"), integer("mode", 0, 6),
                         index_maps("targets", "accessors"),
                         object("extensions", kPrimitiveExtensions)}};
const Schema kMesh{{objects("primitives", kPrimitive, true), numbers("weights", 0), text("name")}};

const Schema kLightReference{{index("light", "lights", true)}};
const Schema kNodeExtensions{{object("KHR_lights_punctual", kLightReference)}};
const Schema kNode{{index("camera", "cameras"), indices("children", "nodes"),
                    index("skin", "skins"), numbers("matrix", 16), index("mesh", "meshes"),
                    numbers("rotation", 4), numbers("scale", 3), numbers("translation", 3),
                    numbers("weights", 0), text("name"), object("extensions", kNodeExtensions)}};
const Schema kSkin{{index("inverseBindMatrices", "accessors"), index("skeleton", "nodes"),
                    indices("joints", "nodes", true), text("name")}};
const Schema kScene{{indices("nodes", "nodes"), text("name")}};

const Schema kSpot{
    {number("innerConeAngle", 0, 1.5707964), number("outerConeAngle", 0, 1.5707964)}};
const Schema kLight{{text("type", true), numbers("color", 3, 0, 1e30), number("intensity", 0, 1e30),
                     number("range", 1e-30, 1e30), object("spot", kSpot), text("name")}};
const Schema kLights{{objects("lights", kLight, true)}};
const Schema kRootExtensions{{object("KHR_lights_punctual", kLights)}};

const Schema kRoot{
    {object("asset", kAsset, true), objects("buffers", kBuffer), objects("bufferViews", kView),
     objects("accessors", kAccessor), objects("images", kImage), objects("samplers", kSampler),
     objects("textures", kTexture), objects("materials", kMaterial), objects("meshes", kMesh),
     objects("nodes", kNode), objects("skins", kSkin), objects("scenes", kScene),
     objects("cameras", kEmpty), index("scene", "scenes"), object("extensions", kRootExtensions)}};

// --- The walk ------------------------------------------------------------------------------------

class Walk {
 public:
  explicit Walk(GltfFile& file) : file_(file) {}

  void object(const JsonAt& at, const Schema& schema) {
    at.expect_object();
    for (const Property& property : schema.properties) {
      const auto member = at.find(property.name);
      if (member) {
        check(*member, property);
      } else if (property.required) {
        at.at(property.name);  // throws with its sentence
      }
    }
  }

 private:
  void check(const JsonAt& at, const Property& p) {
    switch (p.kind) {
      case Kind::text:
        at.string();
        break;
      case Kind::flag:
        at.boolean();
        break;
      case Kind::number:
        in_range(at, p);
        break;
      case Kind::integer:
        at.integer(static_cast<uint64_t>(p.low), static_cast<uint64_t>(p.high));
        break;
      case Kind::numbers:
        number_list(at, p);
        break;
      case Kind::index:
        reference(at, p.section);
        break;
      case Kind::object:
        object(at, *p.schema);
        break;
      case Kind::indices:
        not_empty(at);
        for (size_t i = 0; i < at.size(); ++i) reference(at[i], p.section);
        break;
      case Kind::objects:
        not_empty(at);
        for (size_t i = 0; i < at.size(); ++i) object(at[i], *p.schema);
        break;
      case Kind::index_map:
        map(at, p.section);
        break;
      case Kind::index_maps:
        for (size_t i = 0; i < at.size(); ++i) map(at[i], p.section);
        break;
    }
  }

  void map(const JsonAt& at, const char* section) {
    at.expect_object();
    for (const JsonMember& member : *at.value().object()) {
      reference(JsonAt(member.value, pointer_below(at.where(), member.key)), section);
    }
  }

  static void in_range(const JsonAt& at, const Property& p) {
    const double value = at.number();
    if (!(value >= p.low && value <= p.high)) {
      at.fail(std::string("The property '") + p.name + "' is out of its range.");
    }
  }

  static void number_list(const JsonAt& at, const Property& p) {
    if (p.length != 0 && at.size() != p.length) {
      at.fail(std::string("The property '") + p.name + "' must hold " + std::to_string(p.length) +
              " numbers, but holds " + std::to_string(at.size()) + ".");
    }
    for (size_t i = 0; i < at.size(); ++i) in_range(at[i], p);
  }

  // A null section: any index that fits 31 bits (the unique ids of a Draco stream).
  void reference(const JsonAt& at, const char* section) {
    const uint64_t index = at.integer(0, 0x7fffffff);
    if (!section) return;
    const size_t size =
        std::string_view(section) == "lights" ? lights() : section_size(file_.json, section);
    if (index >= size) {
      at.fail("Index " + std::to_string(index) + " points past the end of '" + section +
              "', which has " + std::to_string(size) + " elements.");
    }
  }

  size_t lights() const {
    const JsonValue* extensions = file_.json.find("extensions");
    const JsonValue* punctual = extensions ? extensions->find("KHR_lights_punctual") : nullptr;
    return punctual ? section_size(*punctual, "lights") : 0;
  }

  void not_empty(const JsonAt& at) {
    if (at.size() == 0) {
      file_.warnings.push_back("The array at " + at.where() +
                               " is empty, which glTF forbids; it is taken as absent.");
    }
  }

  GltfFile& file_;
};

void check_version(const JsonAt& asset) {
  const auto refuse = [](const JsonAt& at) {
    throw Error(ErrorCode::unsupported,
                "The glTF is of version '" + at.string().substr(0, 40) + "'; 2.0 is supported.",
                at.where());
  };
  const JsonAt version = asset.at("version");
  if (!version.string().starts_with("2.")) refuse(version);
  if (const auto minimum = asset.find("minVersion"); minimum && minimum->string() != "2.0") {
    refuse(*minimum);
  }
}

// KHR_lights_punctual: a spot light must have its cone, were it only "{}".
void check_spots(const JsonAt& root) {
  const auto extensions = root.find("extensions");
  const auto punctual = extensions ? extensions->find("KHR_lights_punctual") : std::nullopt;
  const auto lights = punctual ? punctual->find("lights") : std::nullopt;
  for (size_t i = 0; lights && i < lights->size(); ++i) {
    const JsonAt light = (*lights)[i];
    if (light.at("type").string() == "spot") light.at("spot");
  }
}

}  // namespace

size_t section_size(const JsonValue& root, std::string_view name) {
  const JsonValue* section = root.find(name);
  return section && section->array() ? section->array()->size() : 0;
}

void check_schema(GltfFile& file) {
  const JsonAt root(file.json, "");
  Walk(file).object(root, kRoot);
  check_version(root.at("asset"));
  check_spots(root);
}

}  // namespace lightkiln
