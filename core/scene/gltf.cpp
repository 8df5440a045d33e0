// load_gltf: the way from a client's bytes to a Scene, one step a function.

#include "core/scene/gltf.h"

#include <algorithm>
#include <set>

#include "core/base/error.h"
#include "core/scene/gltf_model.h"
#include "core/scene/gltf_pose.h"
#include "core/scene/gltf_primitive.h"
#include "core/scene/gltf_textures.h"
#include "core/scene/mesh_cleanup.h"
#include "core/scene/mesh_topology.h"
#include "core/scene/normals.h"

namespace lightkiln {

namespace {

constexpr size_t kMaxSurfaceMeshes = 1'000'000;
constexpr size_t kMaxWarnings = 100;
constexpr double kWeldTolerance = 1e-6;  // of the scene's extent

// A SurfaceMesh before the scene's box is known.
struct PosedMesh {
  SurfaceMesh mesh;
  std::vector<Vec3d> world;
  std::vector<Vec3d> normals;  // world space, unit or zero
  std::vector<bool> bad;
};

// --- Posing --------------------------------------------------------------------------------------

// The map of each vertex: one for a rigid mesh, a weighted mean of joints for a skinned one.
class VertexMaps {
 public:
  explicit VertexMaps(const Affine& rigid) : rigid_(rigid) {}
  VertexMaps(std::vector<Affine> joints, const PrimitiveData& data, const std::string& where)
      : joints_(std::move(joints)), data_(&data) {
    for (const auto& set : data.influences) {
      for (const JointWeights& influence : set) {
        for (size_t k = 0; k < 4; ++k) {
          if (influence.joints[k] >= joints_.size() && influence.weights[k] != 0) {
            throw Error(ErrorCode::invalid_input,
                        "A vertex names joint " + std::to_string(influence.joints[k]) +
                            ", but its skin has " + std::to_string(joints_.size()) + ".",
                        where + "/attributes");
          }
        }
      }
    }
  }

  bool skinned() const { return data_ != nullptr; }

  // glTF 2.0, section 3.7.3.3: v' = sum_j w_j J_j v, here divided by sum_j w_j, which the file
  // promises to be one. Vertices without any weight stay with their first joint.
  Affine operator()(size_t vertex) const {
    if (!data_) return rigid_;
    Affine blend{};
    for (auto& row : blend.linear) row[0] = row[1] = row[2] = 0;
    double sum = 0;
    for (const auto& set : data_->influences) {
      for (size_t k = 0; k < 4; ++k) {
        const double weight = double{set[vertex].weights[k]};
        if (weight == 0) continue;
        add(blend, joints_[set[vertex].joints[k]], weight);
        sum += weight;
      }
    }
    if (sum == 0) {
      return joints_[std::min<size_t>(data_->influences[0][vertex].joints[0], joints_.size() - 1)];
    }
    for (auto& row : blend.linear) {
      for (double& value : row) value /= sum;
    }
    blend.translation = blend.translation / sum;
    return blend;
  }

 private:
  static void add(Affine& to, const Affine& from, double weight) {
    for (size_t row = 0; row < 3; ++row) {
      for (size_t column = 0; column < 3; ++column) {
        to.linear[row][column] += weight * from.linear[row][column];
      }
    }
    to.translation += from.translation * weight;
  }

  Affine rigid_;
  std::vector<Affine> joints_;
  const PrimitiveData* data_ = nullptr;
};

PosedMesh pose(PrimitiveData data, const VertexMaps& maps, SceneReport& report) {
  PosedMesh posed;
  const size_t count = data.positions.size();
  posed.world.resize(count);
  posed.normals.resize(data.normals.size());
  std::vector<bool> mirrored(count, false);
  for (size_t i = 0; i < count; ++i) {
    const Affine map = maps(i);
    posed.world[i] = map.point(to_double(data.positions[i]));
    mirrored[i] = determinant(map) < 0;
    if (!data.normals.empty()) {
      posed.normals[i] = transformed_normal(map, to_double(data.normals[i]));
    }
  }
  posed.bad = find_bad_vertices(data.positions, posed.world, report);
  drop_broken(data.triangles, posed.bad, report);
  if (maps.skinned()) {
    drop_degenerate(data.triangles, posed.world, report);
  } else if (is_singular(maps(0))) {
    report.dropped_degenerate_triangles += data.triangles.size();
    data.triangles.clear();
  } else {
    drop_degenerate(data.triangles, data.positions, report);
  }
  for (Triangle& t : data.triangles) {
    if (mirrored[t[0]]) std::swap(t[1], t[2]);
  }
  SurfaceMesh& mesh = posed.mesh;
  mesh.normals_from_file = !data.normals.empty();
  // Counted on the stored lengths: transforms are undone by normalising. Quantised normals may be
  // off by a part in a hundred.
  for (size_t i = 0; i < data.normals.size(); ++i) {
    const double size = length(to_double(data.normals[i]));
    if (!(std::abs(size - 1) <= 0.01)) ++report.repaired_normals;
  }
  mesh.texcoords[0] = std::move(data.texcoords[0]);
  mesh.texcoords[1] = std::move(data.texcoords[1]);
  mesh.colors = std::move(data.colors);
  mesh.triangles = std::move(data.triangles);
  return posed;
}

// --- Loading -------------------------------------------------------------------------------------

class Loader {
 public:
  Loader(const GltfSource& source, const GltfLoadOptions& options)
      : options_(options),
        file_(open_gltf(source.main, options.limits)),
        bytes_(file_, source),
        model_(read_model(file_)),
        world_(world_transforms(model_)) {
    budget_.triangles = options.limits.max_triangles;
    budget_.vertices = options.limits.max_triangles * 3;
  }

  Scene load() {
    scene_.materials = model_.materials;
    for (const size_t node : scene_nodes(model_)) {
      if (model_.nodes[node].mesh >= 0) load_node(node);
      if (model_.nodes[node].light >= 0) place_light(node);
    }
    refuse_many_bad_vertices(scene_.report);
    normalise();
    drop_duplicates(scene_.meshes, scene_.report);
    finish_meshes();
    load_textures(scene_, model_, bytes_, options_);
    collect_warnings();
    return std::move(scene_);
  }

 private:
  void load_node(size_t node) {
    const GltfNode& from = model_.nodes[node];
    const auto mesh = static_cast<size_t>(from.mesh);
    const GltfMesh& shown = model_.meshes[mesh];
    const std::vector<double>& weights = from.weights.empty() ? shown.weights : from.weights;
    for (size_t i = 0; i < shown.primitives.size(); ++i) {
      const GltfPrimitive& primitive = shown.primitives[i];
      const std::string where =
          "/meshes/" + std::to_string(mesh) + "/primitives/" + std::to_string(i);
      if (!makes_triangles(primitive.mode)) {
        ++scene_.report.ignored_points_and_lines;
        continue;
      }
      if (!primitive.attributes.contains("POSITION")) {
        warn("The primitive at " + where + " has no positions and is ignored.");
        continue;
      }
      load_primitive(node, mesh, i, weights, where);
    }
  }

  void load_primitive(size_t node, size_t mesh, size_t index, const std::vector<double>& weights,
                      const std::string& where) {
    if (posed_.size() >= kMaxSurfaceMeshes) {
      throw Error(ErrorCode::too_large, "The scene shows more than " +
                                            std::to_string(kMaxSurfaceMeshes) + " primitives.");
    }
    const GltfPrimitive& primitive = model_.meshes[mesh].primitives[index];
    const DecodedAccessors* decoded = nullptr;
    if (primitive.draco) {
      auto [slot, added] = draco_.try_emplace({mesh, index});
      if (added) slot->second = decode_primitive(file_, bytes_, primitive, where);
      decoded = &slot->second;
    }
    const AccessorSource source{file_, bytes_, decoded};
    const PrimitiveData data = read_primitive(source, primitive, weights, where, budget_);
    for (const std::string& warning : data.warnings) warn(warning);
    if (data.morphed) warn("Morph targets are baked with their default weights.");
    scene_.report.vertices += data.positions.size();

    const int skin = model_.nodes[node].skin;
    PosedMesh posed;
    if (skin >= 0 && !data.influences.empty()) {
      warn("Skinned meshes are baked in the pose that the file's nodes stand in.");
      const auto joints = joint_transforms(model_, static_cast<size_t>(skin), world_,
                                           AccessorSource{file_, bytes_});
      if (joints.empty()) {
        throw Error(ErrorCode::invalid_input, "The skin has no joints.",
                    "/skins/" + std::to_string(skin) + "/joints");
      }
      posed = pose(data, VertexMaps(joints, data, where), scene_.report);
    } else {
      if (is_singular(world_[node])) {
        warn("Node " + std::to_string(node) +
             " flattens its mesh (its transform has no inverse); its triangles are dropped.");
      }
      posed = pose(data, VertexMaps(world_[node]), scene_.report);
    }
    name_mesh(posed.mesh, node, mesh, index);
    posed.mesh.material = material_of(primitive);
    warn_of_absent_texcoords(posed.mesh, where);
    posed_.push_back(std::move(posed));
  }

  void name_mesh(SurfaceMesh& to, size_t node, size_t mesh, size_t primitive) const {
    const auto named = [](const std::string& name, size_t index) {
      return name.empty() ? std::to_string(index) : name;
    };
    to.name = named(model_.nodes[node].name, node) + "/" + named(model_.meshes[mesh].name, mesh);
    to.node = static_cast<int>(node);
    to.mesh = static_cast<int>(mesh);
    to.primitive = static_cast<int>(primitive);
  }

  void warn_of_absent_texcoords(const SurfaceMesh& mesh, const std::string& where) {
    const Material& material = scene_.materials[static_cast<size_t>(mesh.material)];
    for (const TextureSlot* slot : {&material.base_color_texture, &material.emissive_texture}) {
      if (slot->texture >= 0 && mesh.texcoords[slot->texcoord].empty()) {
        warn("The primitive at " + where + " has no TEXCOORD_" + std::to_string(slot->texcoord) +
             ", which a texture of its material reads.");
      }
    }
  }

  // The default material (glTF 2.0, section 3.9.7) is added at the end when something needs it.
  int material_of(const GltfPrimitive& primitive) {
    if (primitive.material >= 0) return primitive.material;
    if (default_material_ < 0) {
      default_material_ = static_cast<int>(scene_.materials.size());
      scene_.materials.push_back({});
    }
    return default_material_;
  }

  // KHR_lights_punctual: light shines along the node's -Z.
  void place_light(size_t node) {
    PunctualLight light = model_.lights[static_cast<size_t>(model_.nodes[node].light)];
    const Vec3d direction = world_[node].vector({0, 0, -1});
    const double size = length(direction);
    light.position = world_[node].translation;
    if (!is_finite(light.position) || !std::isfinite(size) ||
        (light.kind != LightKind::point && !(size > 0))) {
      warn("The light of node " + std::to_string(node) +
           " is ignored: its transform leaves it no position or direction.");
      return;
    }
    light.direction = size > 0 ? direction / size : Vec3d{0, 0, -1};
    if (light.name.empty()) light.name = model_.nodes[node].name;
    scene_.lights.push_back(std::move(light));
  }

  void normalise() {
    Bounds box;
    for (const PosedMesh& posed : posed_) {
      for (const Triangle& t : posed.mesh.triangles) {
        for (const uint32_t i : t) grow(box, posed.world[i]);
      }
    }
    scene_.normalisation = make_normalisation(box);
    for (PosedMesh& posed : posed_) {
      SurfaceMesh& mesh = posed.mesh;
      mesh.positions.resize(posed.world.size());
      for (size_t i = 0; i < posed.world.size(); ++i) {
        if (posed.bad[i]) continue;
        const Vec3 p = to_float(scene_.normalisation.to_normalised(posed.world[i]));
        // So far outside the box only where no triangle reaches: nothing there can be traced.
        if (std::abs(p.x) < kOversize && std::abs(p.y) < kOversize && std::abs(p.z) < kOversize) {
          mesh.positions[i] = p;
        }
      }
      posed.world = {};
      drop_degenerate(mesh.triangles, mesh.positions, scene_.report);
      scene_.meshes.push_back(std::move(mesh));
    }
  }

  void finish_meshes() {
    for (size_t m = 0; m < scene_.meshes.size(); ++m) {
      SurfaceMesh& mesh = scene_.meshes[m];
      scene_.report.triangles += mesh.triangles.size();
      for (const Triangle& t : mesh.triangles) {
        for (const uint32_t i : t) grow(scene_.bounds, to_double(mesh.positions[i]));
      }
      set_normals(mesh, posed_[m].normals);
    }
    const Vec3d extent = scene_.bounds.extent();
    const double largest = std::max(extent.x, std::max(extent.y, extent.z));
    const EdgeCounts edges = count_edges(scene_.meshes, kWeldTolerance * largest);
    scene_.report.open_edges = edges.open;
    scene_.report.inconsistent_edges = edges.inconsistent;
  }

  void set_normals(SurfaceMesh& mesh, const std::vector<Vec3d>& from_file) {
    if (!mesh.normals_from_file) ++scene_.report.meshes_without_normals;
    const bool all_there =
        mesh.normals_from_file && std::none_of(from_file.begin(), from_file.end(),
                                               [](const Vec3d& n) { return n == Vec3d{}; });
    if (!all_there) mesh.normals = mean_normals(mesh.positions, mesh.triangles);
    mesh.normals.resize(mesh.positions.size());
    for (size_t i = 0; i < from_file.size(); ++i) {
      if (!(from_file[i] == Vec3d{})) mesh.normals[i] = to_float(from_file[i]);
    }
  }

  void warn(const std::string& sentence) { scene_.report.warnings.push_back(sentence); }

  void collect_warnings() {
    std::vector<std::string> all = file_.warnings;
    all.insert(all.end(), model_.warnings.begin(), model_.warnings.end());
    if (section_size(file_.json, "animations") > 0) all.push_back("Animations are ignored.");
    all.insert(all.end(), scene_.report.warnings.begin(), scene_.report.warnings.end());
    std::set<std::string> seen;
    std::erase_if(all, [&](const std::string& sentence) { return !seen.insert(sentence).second; });
    if (all.size() > kMaxWarnings) {
      const size_t more = all.size() - kMaxWarnings;
      all.resize(kMaxWarnings);
      all.push_back("There are " + std::to_string(more) + " more warnings.");
    }
    scene_.report.warnings = std::move(all);
  }

  const GltfLoadOptions& options_;
  GltfFile file_;
  GltfBytes bytes_;
  GltfModel model_;
  std::vector<Affine> world_;
  LoadBudget budget_;
  std::map<std::pair<size_t, size_t>, DecodedAccessors> draco_;
  std::vector<PosedMesh> posed_;
  int default_material_ = -1;
  Scene scene_;
};

}  // namespace

Scene load_gltf(const GltfSource& source, const GltfLoadOptions& options) {
  return Loader(source, options).load();
}

}  // namespace lightkiln
