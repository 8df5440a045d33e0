// write_glb: the source's own JSON tree, edited as little as the task asks. Sections keep their
// indices, so that references from extensions that are not understood stay valid; what changes is
// where buffer views point (into one new binary chunk), and what is added at the end of sections.

#include <algorithm>
#include <set>

#include "core/base/error.h"
#include "core/scene/glb_container.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_model.h"
#include "core/scene/gltf_primitive.h"

namespace lightkiln {

namespace {

const char* const kCompressions[] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                     "KHR_meshopt_compression"};

constexpr size_t kMaxUndefinedBytes = size_t{16} << 20;

const char* mime_type(std::span<const std::byte> image) {
  const auto starts = [&](std::string_view magic) {
    return image.size() >= magic.size() &&
           std::equal(magic.begin(), magic.end(), image.begin(),
                      [](char a, std::byte b) { return static_cast<std::byte>(a) == b; });
  };
  if (starts("\x89PNG")) return "image/png";
  if (starts("\xff\xd8\xff")) return "image/jpeg";
  if (starts("RIFF")) return "image/webp";
  if (starts("\xabKTX")) return "image/ktx2";
  return "application/octet-stream";
}

// Removes an extension from an object, and the "extensions" property when nothing is left in it.
void erase_extension(JsonValue& object, const char* name) {
  JsonValue* extensions = object.find("extensions");
  if (!extensions) return;
  extensions->erase(name);
  if (extensions->object() && extensions->object()->empty()) object.erase("extensions");
}

class Writer {
 public:
  Writer(const GltfSource& source, const Scene& scene)
      : scene_(scene),
        file_(open_gltf(source.main, {})),
        bytes_(file_, source),
        model_(read_model(file_)),
        json_(file_.json) {}

  std::vector<std::byte> write(std::span<const VertexAttribute> attributes,
                               const std::string& generator) {
    json_.at_asset().set("generator", json_string(generator));
    unfold_draco();
    copy_views();
    embed_images();
    const std::vector<size_t> meshes = one_mesh_a_node();
    for (const VertexAttribute& attribute : attributes) add_attribute(attribute, meshes);
    drop_compressions();
    finish_buffers();
    return glb_container(to_text(json_.root), bin_);
  }

 private:
  // The tree being edited, with its sections made on demand.
  struct Tree {
    JsonValue root;
    explicit Tree(JsonValue value) : root(std::move(value)) {}
    JsonValue& at_asset() { return *root.find("asset"); }
    JsonArray& section(const char* name) {
      JsonValue* found = root.find(name);
      return *(found ? *found : root.set(name, {JsonArray{}})).array();
    }
  };

  size_t append_bytes(std::span<const std::byte> bytes) {
    while (bin_.size() % 4 != 0) bin_.push_back(std::byte{0});
    const size_t offset = bin_.size();
    bin_.insert(bin_.end(), bytes.begin(), bytes.end());
    return offset;
  }

  void place_view(JsonValue& view, std::span<const std::byte> bytes) {
    view.set("buffer", json_number(0));
    view.set("byteOffset", json_number(static_cast<double>(append_bytes(bytes))));
    view.set("byteLength", json_number(static_cast<double>(bytes.size())));
  }

  size_t add_view(std::span<const std::byte> bytes, int target) {
    JsonValue view{JsonObject{}};
    place_view(view, bytes);
    if (target != 0) view.set("target", json_number(target));
    JsonArray& views = json_.section("bufferViews");
    views.push_back(std::move(view));
    return views.size() - 1;
  }

  // The decoded attributes of a Draco primitive become views of their own. The first takes the
  // place of the compressed view, so that indices stay and no dead bytes do.
  void unfold_draco() {
    std::set<size_t> unfolded;
    for (size_t m = 0; m < model_.meshes.size(); ++m) {
      for (size_t p = 0; p < model_.meshes[m].primitives.size(); ++p) {
        const GltfPrimitive& primitive = model_.meshes[m].primitives[p];
        if (!primitive.draco) continue;
        const std::string where =
            "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p);
        for (const auto& [accessor, bytes] : decode_primitive(file_, bytes_, primitive, where)) {
          if (unfolded.insert(accessor).second) {
            unfold_accessor(accessor, bytes, primitive.draco->view,
                            accessor == *primitive.indices ? 34963 : 34962);
          }
        }
        erase_extension(primitive_json(m, p), kCompressions[0]);
      }
    }
  }

  void unfold_accessor(size_t accessor, std::span<const std::byte> bytes, size_t compressed,
                       int target) {
    // Vertex attributes must start at multiples of four, also within the view.
    const GltfAccessor& from = file_.accessors[accessor];
    const size_t packed = from.packed_stride();
    const size_t stride = target == 34962 ? (packed + 3) / 4 * 4 : packed;
    std::vector<std::byte> spread(from.count * stride, std::byte{0});
    for (size_t i = 0; i < from.count; ++i) {
      std::copy_n(bytes.begin() + static_cast<ptrdiff_t>(i * packed), packed,
                  spread.begin() + static_cast<ptrdiff_t>(i * stride));
    }
    size_t index = compressed;
    if (replaced_.insert(compressed).second) {
      JsonValue view{JsonObject{}};
      place_view(view, spread);
      view.set("target", json_number(target));
      json_.section("bufferViews")[compressed] = std::move(view);
    } else {
      index = add_view(spread, target);
    }
    if (stride != packed) {
      json_.section("bufferViews")[index].set("byteStride",
                                              json_number(static_cast<double>(stride)));
    }
    JsonValue& json = json_.section("accessors")[accessor];
    json.set("bufferView", json_number(static_cast<double>(index)));
    json.erase("byteOffset");
    refresh_bounds(json, accessor, bytes, target);
  }

  // What the file states as least and greatest belongs to the values before compression.
  void refresh_bounds(JsonValue& json, size_t accessor, std::span<const std::byte> bytes,
                      int target) {
    const bool stated = json.find("min") || json.find("max");
    json.erase("min");
    json.erase("max");
    const GltfAccessor& from = file_.accessors[accessor];
    if (!stated || target != 34962 || from.component != ComponentType::f32) return;
    const DecodedAccessors decoded{{accessor, {bytes.begin(), bytes.end()}}};
    const std::vector<float> values = read_floats({file_, bytes_, &decoded}, accessor);
    std::vector<float> low(from.rows, INFINITY), high(from.rows, -INFINITY);
    for (size_t i = 0; i < values.size(); ++i) {
      low[i % from.rows] = std::min(low[i % from.rows], values[i]);
      high[i % from.rows] = std::max(high[i % from.rows], values[i]);
    }
    const auto list = [](const std::vector<float>& numbers) {
      JsonArray items;
      for (const float number : numbers) items.push_back(json_number(double{number}));
      return JsonValue{std::move(items)};
    };
    json.set("min", list(low));
    json.set("max", list(high));
  }

  // Contents that the file leaves undefined, and that nothing reads, are written as zeros.
  void copy_views() {
    for (size_t i = 0; i < file_.views.size(); ++i) {
      if (replaced_.contains(i)) continue;
      JsonValue& view = json_.section("bufferViews")[i];
      const GltfView& from = file_.views[i];
      if (!from.meshopt && !bytes_.defined(from.buffer)) {
        if (from.length > kMaxUndefinedBytes) {
          throw Error(ErrorCode::too_large,
                      "The view has " + std::to_string(from.length) +
                          " bytes of undefined contents; at most " +
                          std::to_string(kMaxUndefinedBytes) + " can be written.",
                      "/bufferViews/" + std::to_string(i));
        }
        place_view(view, std::vector<std::byte>(from.length));
        continue;
      }
      place_view(view, bytes_.view(i));
      for (const char* name : kCompressions) erase_extension(view, name);
    }
  }

  void embed_images() {
    for (size_t i = 0; i < file_.images.size(); ++i) {
      if (!file_.images[i].uri) continue;
      const auto bytes = bytes_.image(i);
      JsonValue& image = json_.section("images")[i];
      image.erase("uri");
      image.set("bufferView", json_number(static_cast<double>(add_view(bytes, 0))));
      image.set("mimeType", json_string(mime_type(bytes)));
    }
  }

  JsonValue& primitive_json(size_t mesh, size_t primitive) {
    return (*json_.section("meshes")[mesh].find("primitives")->array())[primitive];
  }

  // For every SurfaceMesh the index of the JSON mesh that will carry its attributes. A mesh shown
  // by one node stays; each further node gets a copy, and so does the first one if a node outside
  // the scene shows the mesh too, which must stay without attributes.
  std::vector<size_t> one_mesh_a_node() {
    std::vector<size_t> shown(model_.meshes.size(), 0), in_scene(model_.meshes.size(), 0);
    for (const GltfNode& node : model_.nodes) {
      if (node.mesh >= 0) ++shown[static_cast<size_t>(node.mesh)];
    }
    std::map<int, size_t> mesh_of_node;
    for (const SurfaceMesh& surface : scene_.meshes) {
      if (mesh_of_node.try_emplace(surface.node, 0).second) {
        ++in_scene[static_cast<size_t>(surface.mesh)];
      }
    }
    mesh_of_node.clear();
    std::set<size_t> taken;
    const JsonArray originals = json_.section("meshes");
    std::vector<size_t> result;
    for (const SurfaceMesh& surface : scene_.meshes) {
      const auto mesh = static_cast<size_t>(surface.mesh);
      auto [slot, added] = mesh_of_node.try_emplace(surface.node, mesh);
      if (added && (shown[mesh] > in_scene[mesh] || !taken.insert(mesh).second)) {
        JsonArray& meshes = json_.section("meshes");
        meshes.push_back(originals[mesh]);
        slot->second = meshes.size() - 1;
        json_.section("nodes")[static_cast<size_t>(surface.node)].set(
            "mesh", json_number(static_cast<double>(slot->second)));
      }
      result.push_back(slot->second);
    }
    return result;
  }

  void add_attribute(const VertexAttribute& attribute, const std::vector<size_t>& meshes) {
    size_t expected = 0, first = 0;
    for (const SurfaceMesh& surface : scene_.meshes) expected += surface.positions.size();
    if (attribute.values.size() != expected) {
      throw Error(ErrorCode::internal, "The attribute " + attribute.name + " has " +
                                           std::to_string(attribute.values.size()) +
                                           " values for " + std::to_string(expected) +
                                           " vertices.");
    }
    for (size_t i = 0; i < scene_.meshes.size(); ++i) {
      const SurfaceMesh& surface = scene_.meshes[i];
      const auto values = attribute.values.subspan(first, surface.positions.size());
      first += values.size();
      JsonValue accessor{JsonObject{}};
      accessor.set("bufferView",
                   json_number(static_cast<double>(add_view(std::as_bytes(values), 34962))));
      accessor.set("componentType", json_number(5126));
      accessor.set("count", json_number(static_cast<double>(values.size())));
      accessor.set("type", json_string("SCALAR"));
      JsonArray& accessors = json_.section("accessors");
      accessors.push_back(std::move(accessor));
      primitive_json(meshes[i], static_cast<size_t>(surface.primitive))
          .find("attributes")
          ->set(attribute.name, json_number(static_cast<double>(accessors.size() - 1)));
    }
  }

  void drop_compressions() {
    for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
      JsonValue* names = json_.root.find(list);
      if (!names) continue;
      std::erase_if(*names->array(), [](const JsonValue& name) {
        return std::any_of(std::begin(kCompressions), std::end(kCompressions),
                           [&](const char* c) { return std::get<std::string>(name.data) == c; });
      });
      if (names->array()->empty()) json_.root.erase(list);
    }
  }

  void finish_buffers() {
    if (bin_.empty()) {
      json_.root.erase("buffers");
      return;
    }
    JsonValue buffer{JsonObject{}};
    buffer.set("byteLength", json_number(static_cast<double>(bin_.size())));
    json_.root.set("buffers", {JsonArray{std::move(buffer)}});
  }

  const Scene& scene_;
  GltfFile file_;
  GltfBytes bytes_;
  GltfModel model_;
  Tree json_;
  std::vector<std::byte> bin_;
  std::set<size_t> replaced_;  // compressed views whose place a decoded one has taken
};

}  // namespace

std::vector<std::byte> write_glb(const GltfSource& source, const Scene& scene,
                                 std::span<const VertexAttribute> attributes,
                                 const std::string& generator) {
  return Writer(source, scene).write(attributes, generator);
}

}  // namespace lightkiln
