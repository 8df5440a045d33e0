// Malformed files made by others: what each must do here, written out one by one.

#include <optional>
#include <set>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/data.h"
#include "tests/support/gltf_files.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

constexpr std::nullopt_t kLoads = std::nullopt;

struct Expected {
  const char* path;  // below invalid/, or invalid/gltf_validator/ for errors/
  std::optional<ErrorCode> code;
  const char* where;
};

// A file that loads here has a fault that no bake depends on: animations and cameras, extents
// declared wrongly, empty arrays (warned of), hints, normals (repaired and counted), joints that
// nothing shows, properties out of range in extensions that are not read.
const Expected kFiles[] = {
    {"gltf_assimp/BoxBadNormals-glTF-Binary/BoxBadNormals.glb", kLoads, ""},
    {"gltf_assimp/IndexOutOfRange/IndexOutOfRange.gltf", ErrorCode::invalid_input, "/accessors/0"},
    {"gltf_assimp/MissingBin/BoxTextured.gltf", ErrorCode::invalid_input, "/buffers/0/uri"},
    {"gltf_assimp/RecursiveNodes/RecursiveNodes.gltf", ErrorCode::invalid_input,
     "/nodes/1/children/0"},
    {"gltf_assimp/TestNoRootNode/NoScene.gltf", ErrorCode::invalid_input, "/scene"},
    {"gltf_assimp/wrongTypes/badArray.gltf", ErrorCode::invalid_input, "/meshes/0/primitives"},
    {"gltf_assimp/wrongTypes/badNumber.gltf", ErrorCode::invalid_input,
     "/materials/0/normalTexture"},
    {"gltf_assimp/wrongTypes/badString.gltf", ErrorCode::invalid_input, "/scenes/0/name"},
    {"gltf_tinygltf/integer-out-of-bounds.gltf", ErrorCode::invalid_input,
     "/bufferViews/0/byteLength"},
    {"gltf_tinygltf/invalid-buffer-index.gltf", ErrorCode::invalid_input, "/bufferViews/1/buffer"},
    {"errors/accessor/byteoffset_no_bufferview.gltf", ErrorCode::invalid_input, "/accessors/0"},
    {"errors/accessor/empty_object.gltf", ErrorCode::invalid_input, "/accessors/0"},
    {"errors/accessor/invalid_sparse_count_and_stride.gltf", ErrorCode::invalid_input,
     "/accessors/0/sparse/count"},
    {"errors/accessor/matrix_alignment.gltf", ErrorCode::invalid_input, "/accessors/0"},
    {"errors/accessor_data/invalid_elements_float.gltf", kLoads, ""},
    {"errors/accessor_data/out_of_range_elements_uint16.gltf", kLoads, ""},
    {"errors/accessor_data/out_of_range_elements_uint8.gltf", kLoads, ""},
    {"errors/animation/channel_node_matrix.gltf", kLoads, ""},
    {"errors/animation/channel_node_no_morphs.gltf", kLoads, ""},
    {"errors/animation/empty_array.gltf", kLoads, ""},
    {"errors/animation/sampler_bufferview_bytestride.gltf", kLoads, ""},
    {"errors/animation/sampler_input_format_invalid.gltf", kLoads, ""},
    {"errors/animation/sampler_output_count_invalid.gltf", kLoads, ""},
    {"errors/animation/sampler_output_format_invalid.gltf", kLoads, ""},
    {"errors/animation/unresolved_channel_sampler.gltf", kLoads, ""},
    {"errors/animation/unresolved_sampler_input.gltf", kLoads, ""},
    {"errors/animation_data/quaternion_cubic_non_unit_values.gltf", kLoads, ""},
    {"errors/asset/invalid_version.gltf", ErrorCode::unsupported, "/asset/version"},
    {"errors/asset/min_version_invalid.gltf", ErrorCode::unsupported, "/asset/minVersion"},
    {"errors/buffer/invalid_uri_data.glb", ErrorCode::invalid_input, "/buffers/0/uri"},
    {"errors/buffer/invalid_uri_data_bytelength.gltf", ErrorCode::invalid_input, "/buffers/1"},
    {"errors/buffer/invalid_uri_data_mime.gltf", kLoads, ""},
    {"errors/buffer/invalid_uri_scheme.gltf", ErrorCode::invalid_input, "/buffers/0/uri"},
    {"errors/buffer_view/empty_array.gltf", kLoads, ""},
    {"errors/buffer_view/invalid_length.gltf", ErrorCode::invalid_input, "/bufferViews/0"},
    {"errors/buffer_view/invalid_stride_multiple.gltf", ErrorCode::invalid_input,
     "/bufferViews/0/byteStride"},
    {"errors/buffer_view/invalid_stride_too_big.gltf", ErrorCode::invalid_input,
     "/bufferViews/0/byteStride"},
    {"errors/buffer_view/unresolved_buffer.gltf", ErrorCode::invalid_input,
     "/bufferViews/0/buffer"},
    {"errors/camera/empty_objects.gltf", kLoads, ""},
    {"errors/camera/orthographic_z.gltf", kLoads, ""},
    {"errors/ext_KHR_lights_punctual/light/empty_light_object.gltf", ErrorCode::invalid_input,
     "/extensions/KHR_lights_punctual/lights/0"},
    {"errors/ext_KHR_lights_punctual/light/empty_lights_array.gltf", kLoads, ""},
    {"errors/ext_KHR_lights_punctual/light/spot_invalid_angles.gltf", ErrorCode::invalid_input,
     "/extensions/KHR_lights_punctual/lights/0/spot"},
    {"errors/ext_KHR_lights_punctual/light/spot_light_without_spot_object.gltf",
     ErrorCode::invalid_input, "/extensions/KHR_lights_punctual/lights/0"},
    {"errors/ext_KHR_lights_punctual/node/unresolved_light_empty_root_array.gltf",
     ErrorCode::invalid_input, "/nodes/0/extensions/KHR_lights_punctual/light"},
    {"errors/ext_KHR_lights_punctual/node/unresolved_light_empty_root_ext.gltf",
     ErrorCode::invalid_input, "/nodes/0/extensions/KHR_lights_punctual/light"},
    {"errors/ext_KHR_lights_punctual/node/unresolved_light_no_root_ext.gltf",
     ErrorCode::invalid_input, "/nodes/0/extensions/KHR_lights_punctual/light"},
    {"errors/ext_KHR_materials_clearcoat/material/no_tangent_space.gltf", kLoads, ""},
    {"errors/ext_KHR_materials_clearcoat/material/unexpected_extension.gltf", kLoads, ""},
    {"errors/ext_KHR_materials_emissive_strength/material/out_of_range.gltf",
     ErrorCode::invalid_input,
     "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength"},
    {"errors/ext_KHR_materials_specular/material/out_of_range.gltf", kLoads, ""},
    {"errors/ext_KHR_materials_specular/material/unexpected_extension.gltf", kLoads, ""},
    {"errors/ext_KHR_materials_transmission/material/unexpected_extension.gltf", kLoads, ""},
    {"errors/ext_KHR_materials_unlit/material/unexpected_extension.gltf", kLoads, ""},
    {"errors/ext_KHR_mesh_quantization/primitive/non_required.gltf", kLoads, ""},
    {"errors/ext_KHR_texture_transform/textureInfo/unexpected_extension.gltf", kLoads, ""},
    {"errors/ext_KHR_texture_transform/textureInfo/uv_sets.gltf", kLoads, ""},
    {"errors/glb/empty_file.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/empty_json_chunk.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/empty_json_object.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/invalid_json_chunk.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/invalid_version.glb", ErrorCode::unsupported, ""},
    {"errors/glb/json_and_two_buffers.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/no_header.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/only_bin_chunk.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/only_header.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/two_bin_chunks.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/two_empty_bin_chunks.glb", ErrorCode::invalid_input, ""},
    {"errors/glb/zero_length.glb", ErrorCode::invalid_input, ""},
    {"errors/image/buffer_view_bytestride.gltf", kLoads, ""},
    {"errors/image/empty_object.gltf", ErrorCode::invalid_input, "/images/0"},
    {"errors/image/missing_mime_type_buffer_view.gltf", kLoads, ""},
    {"errors/json/bom.gltf", ErrorCode::invalid_input, ""},
    {"errors/json/empty_file.gltf", ErrorCode::invalid_input, ""},
    {"errors/json/invalid_object.gltf", ErrorCode::invalid_input, ""},
    {"errors/material/empty_array.gltf", kLoads, ""},
    {"errors/material/unresolved_mr.gltf", ErrorCode::invalid_input,
     "/materials/0/pbrMetallicRoughness/metallicRoughnessTexture/index"},
    {"errors/material/unresolved_normal.gltf", ErrorCode::invalid_input,
     "/materials/0/normalTexture/index"},
    {"errors/mesh/accessor_attribute_uint32.gltf", kLoads, ""},
    {"errors/mesh/accessor_without_bytestride.gltf", kLoads, ""},
    {"errors/mesh/bufferview_target_override.gltf", kLoads, ""},
    {"errors/mesh/empty_array.gltf", kLoads, ""},
    {"errors/mesh/indices_bytestride.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/indices"},
    {"errors/mesh/indices_invalid_format.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/indices"},
    {"errors/mesh/invalid_attribute.gltf", kLoads, ""},
    {"errors/mesh/invalid_indexed_attribute.gltf", kLoads, ""},
    {"errors/mesh/morph_attribute_no_base.gltf", kLoads, ""},
    {"errors/mesh/position_accessor_invalid_format.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/attributes/POSITION"},
    {"errors/mesh/unresolved_indices.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/indices"},
    {"errors/mesh/unresolved_morph_positions.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/targets/0/POSITION"},
    {"errors/mesh/unresolved_positions.gltf", ErrorCode::invalid_input,
     "/meshes/0/primitives/0/attributes/POSITION"},
    {"errors/mesh/uv.gltf", kLoads, ""},
    {"errors/mesh_data/joints_no_weights.gltf", ErrorCode::invalid_input, "/bufferViews/0"},
    {"errors/mesh_data/joints_weights_complex.gltf", kLoads, ""},
    {"errors/mesh_data/normals_tangents_non_unit_invalid_sign.gltf", kLoads, ""},
    {"errors/node/empty_children_array.gltf", kLoads, ""},
    {"errors/node/infinite_transform.gltf", ErrorCode::invalid_input, ""},
    {"errors/node/matrix_indecomposable.gltf", ErrorCode::invalid_input, "/nodes/0/matrix"},
    {"errors/node/matrix_trs.gltf", ErrorCode::invalid_input, "/nodes/0/matrix"},
    {"errors/node/node_loop.gltf", ErrorCode::invalid_input, "/nodes/2/children/0"},
    {"errors/node/node_loop_scene.gltf", ErrorCode::invalid_input, "/nodes/0/children/0"},
    {"errors/node/node_parent_override.gltf", ErrorCode::invalid_input, "/nodes/1/children/0"},
    {"errors/node/skin_with_no_mesh.gltf", kLoads, ""},
    {"errors/node/unresolved_camera.gltf", ErrorCode::invalid_input, "/nodes/0/camera"},
    {"errors/node/unresolved_mesh.gltf", ErrorCode::invalid_input, "/nodes/0/mesh"},
    {"errors/node/weights_with_no_mesh.gltf", kLoads, ""},
    {"errors/root/empty_object.gltf", ErrorCode::invalid_input, ""},
    {"errors/root/extensions_non_objects.gltf", kLoads, ""},
    {"errors/root/invalid_array_elements.gltf", ErrorCode::invalid_input, "/samplers/0"},
    {"errors/sampler/empty_array.gltf", kLoads, ""},
    {"errors/scene/empty_array.gltf", kLoads, ""},
    {"errors/scene/unresolved_child_node.gltf", ErrorCode::invalid_input, "/nodes/0/children/0"},
    {"errors/scene/unresolved_default_scene.gltf", ErrorCode::invalid_input, "/scene"},
    {"errors/skin/empty_array.gltf", kLoads, ""},
    {"errors/skin/empty_joints_array.gltf", kLoads, ""},
    {"errors/skin/empty_object.gltf", ErrorCode::invalid_input, "/skins/0"},
    {"errors/skin/ibm_invalid_count.gltf", ErrorCode::invalid_input,
     "/skins/2/inverseBindMatrices"},
    {"errors/skin/no_joints_in_scene.gltf", kLoads, ""},
    {"errors/skin/skeleton_invalid.gltf", kLoads, ""},
    {"errors/skin/unresolved_ibm.gltf", ErrorCode::invalid_input, "/skins/0/inverseBindMatrices"},
    {"errors/skin_data/invalid_ibm.gltf", kLoads, ""},
};

std::filesystem::path full_path(const std::filesystem::path& data, const std::string& path) {
  const bool validator = path.starts_with("errors/");
  return data / "invalid" / (validator ? "gltf_validator/" + path : path);
}

std::vector<std::filesystem::path> gltf_files_below(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".gltf" || extension == ".glb") found.push_back(entry.path());
  }
  return found;
}

}  // namespace

TEST(InvalidFiles, EachIsRefusedAtItsFaultOrLoadsAsWritten) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const Expected& expected : kFiles) {
    SCOPED_TRACE(expected.path);
    const GltfFiles files = read_gltf_files(full_path(data, expected.path));
    try {
      load_gltf(files.source(), {});
      EXPECT_FALSE(expected.code.has_value()) << "loaded";
    } catch (const Error& error) {
      ASSERT_TRUE(expected.code.has_value()) << error.what() << " at " << error.where();
      EXPECT_EQ(error.code(), *expected.code) << error.what();
      EXPECT_EQ(error.where(), expected.where) << error.what();
    }
  }
}

TEST(InvalidFiles, TheTableNamesEveryFile) {
  LIGHTKILN_NEEDS_DATA(data);
  std::set<std::filesystem::path> named;
  for (const Expected& expected : kFiles) named.insert(full_path(data, expected.path));
  for (const char* folder : {"gltf_validator/errors", "gltf_assimp", "gltf_tinygltf"}) {
    for (const auto& path : gltf_files_below(data / "invalid" / folder)) {
      EXPECT_TRUE(named.contains(path)) << path;
    }
  }
}

TEST(InvalidFiles, CleanCompanionsLoadAndAreWrittenBack) {
  LIGHTKILN_NEEDS_DATA(data);
  size_t loaded = 0;
  for (const auto& path : gltf_files_below(data / "invalid/gltf_validator/clean")) {
    SCOPED_TRACE(path);
    const GltfFiles files = read_gltf_files(path);
    const Scene scene = load_gltf(files.source(), {});
    size_t vertices = 0;
    for (const SurfaceMesh& mesh : scene.meshes) vertices += mesh.positions.size();
    const std::vector<float> values(vertices, 1.0f);
    const VertexAttribute attribute{"_AO", values};
    const auto glb = write_glb(files.source(), scene, std::span(&attribute, 1), "test");
    EXPECT_EQ(load_gltf({glb, {}}, {}).meshes.size(), scene.meshes.size());
    ++loaded;
  }
  EXPECT_GE(loaded, 45u);
}

TEST(InvalidFiles, BadNormalsAreRepairedAndCounted) {
  LIGHTKILN_NEEDS_DATA(data);
  const GltfFiles files =
      read_gltf_files(data / "invalid/gltf_assimp/BoxBadNormals-glTF-Binary/BoxBadNormals.glb");
  const Scene scene = load_gltf(files.source(), {});
  EXPECT_GT(scene.report.repaired_normals, 0u);
  for (const Vec3& n : scene.meshes.at(0).normals) EXPECT_NEAR(length(n), 1, 1e-5);
}
