// Scenes written back with attributes, read again by our own loader and compared with the source.

#include <cstring>
#include <numeric>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_accessors.h"
#include "core/scene/gltf_model.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/gltf_files.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

std::vector<float> numbered(const Scene& scene) {
  size_t count = 0;
  for (const SurfaceMesh& mesh : scene.meshes) count += mesh.positions.size();
  std::vector<float> values(count);
  std::iota(values.begin(), values.end(), 0.0f);
  return values;
}

std::vector<std::byte> written(const GltfSource& source, const Scene& scene) {
  const std::vector<float> values = numbered(scene);
  const VertexAttribute attribute{"_AO", values};
  return write_glb(source, scene, std::span(&attribute, 1), "Lightkiln test");
}

// _AO of every surface mesh of the written file, in the order of the scene's meshes.
std::vector<float> attribute_of(const std::vector<std::byte>& bytes, const Scene& scene) {
  const GltfSource source{bytes, {}};
  const GltfFile file = open_gltf(bytes, {});
  GltfBytes data(file, source);
  const GltfModel model = read_model(file);
  std::vector<float> all;
  for (const SurfaceMesh& surface : scene.meshes) {
    const auto mesh = static_cast<size_t>(model.nodes.at(static_cast<size_t>(surface.node)).mesh);
    const GltfPrimitive& primitive =
        model.meshes.at(mesh).primitives.at(static_cast<size_t>(surface.primitive));
    const auto values = read_floats({file, data}, primitive.attributes.at("_AO"));
    all.insert(all.end(), values.begin(), values.end());
  }
  return all;
}

void expect_same_scene(const Scene& a, const Scene& b) {
  ASSERT_EQ(a.meshes.size(), b.meshes.size());
  for (size_t m = 0; m < a.meshes.size(); ++m) {
    EXPECT_EQ(a.meshes[m].positions, b.meshes[m].positions);
    EXPECT_EQ(a.meshes[m].normals, b.meshes[m].normals);
    EXPECT_EQ(a.meshes[m].triangles, b.meshes[m].triangles);
    EXPECT_EQ(a.meshes[m].material, b.meshes[m].material);
    EXPECT_EQ(a.meshes[m].colors, b.meshes[m].colors);
    EXPECT_EQ(a.meshes[m].texcoords[0], b.meshes[m].texcoords[0]);
  }
  ASSERT_EQ(a.textures.size(), b.textures.size());
  for (size_t i = 0; i < a.textures.size(); ++i) EXPECT_EQ(a.textures[i].rgba, b.textures[i].rgba);
  EXPECT_EQ(a.materials.size(), b.materials.size());
  EXPECT_EQ(a.lights.size(), b.lights.size());
  EXPECT_EQ(a.normalisation.centre, b.normalisation.centre);
}

}  // namespace

TEST(WriteGlb, RoundTripKeepsTheSceneAndAddsTheValues) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* path :
       {"cornell_box/CornellBox.glb", "outdoor_mountains/Mountains.gltf",
        "fox_skin_no_normals/Fox.glb", "interior_hotel_room/hotel-room.meshopt.glb",
        "small_features/draco/suzi.draco.glb", "small_features/draco/Box_Draco.glb",
        "small_features/meshopt_quantized/pirate.glb",
        "small_features/uri_with_spaces/CubeImageUriSpaces.gltf",
        "small_features/simple_sparse_accessor/SimpleSparseAccessor.gltf",
        "small_features/simple_skin/SimpleSkin.gltf",
        "small_features/texture_transform/TextureTransformTest.gltf",
        "small_features/animated_morph_cube/AnimatedMorphCube.gltf",
        "small_features/primitive_modes/Mesh_PrimitiveMode_04.gltf",
        "reflection_probe_cubes/Cubes.glb", "degenerate_engine/2CylinderEngine.glb"}) {
    SCOPED_TRACE(path);
    const GltfFiles files = read_gltf_files(data / "scenes" / path);
    const Scene scene = load_gltf(files.source(), {});
    const auto bytes = written(files.source(), scene);
    EXPECT_EQ(bytes, written(files.source(), scene));
    expect_same_scene(scene, load_gltf({bytes, {}}, {}));  // from the one file: all is embedded
    EXPECT_EQ(attribute_of(bytes, scene), numbered(scene));
  }
}

TEST(WriteGlb, CompressionLeavesNoTrace) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* path : {"draco/suzi.draco.glb", "meshopt_quantized/pirate.glb"}) {
    const GltfFiles files = read_gltf_files(data / "scenes/small_features" / path);
    const Scene scene = load_gltf(files.source(), {});
    const auto bytes = written(files.source(), scene);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_EQ(text.find("draco"), std::string::npos);
    EXPECT_EQ(text.find("meshopt"), std::string::npos);
    EXPECT_NE(text.find("Lightkiln test"), std::string::npos);
  }
}

TEST(WriteGlb, InstancesGetMeshesOfTheirOwn) {
  // Two nodes of the scene and one outside it share a mesh.
  const MeshData floor = make_floor(1);
  SceneData data;
  data.parts.push_back({floor, {}, {}});
  auto file = make_glb(data);
  std::string json(reinterpret_cast<const char*>(file.data()) + 20);
  json.resize(json.find_last_of('}', json.find("BIN")) + 1);
  const std::string one = R"("nodes":[{"mesh":0}])";
  json.replace(json.find(one), one.size(),
               R"("nodes":[{"mesh":0},{"mesh":0,"translation":[5,0,0]},{"mesh":0}])");
  json.replace(json.find(R"("nodes":[0])"), 11, R"("nodes":[0,1])");
  uint32_t json_size = 0;
  std::memcpy(&json_size, file.data() + 12, 4);
  file = make_glb_container(json, std::span(file).subspan(28 + json_size));

  const GltfSource source{file, {}};
  const Scene scene = load_gltf(source, {});
  ASSERT_EQ(scene.meshes.size(), 2u);
  const auto bytes = written(source, scene);
  EXPECT_EQ(attribute_of(bytes, scene), numbered(scene));
  const GltfModel model = read_model(open_gltf(bytes, {}));
  EXPECT_EQ(model.meshes.size(), 3u);
  EXPECT_FALSE(
      model.meshes[static_cast<size_t>(model.nodes[2].mesh)].primitives[0].attributes.contains(
          "_AO"));
}

TEST(WriteGlb, UnknownExtensionsAndExtrasSurvive) {
  auto file = make_glb(make_floor(1));
  std::string json(reinterpret_cast<const char*>(file.data()) + 20);
  json.resize(json.find_last_of('}', json.find("BIN")) + 1);
  json.replace(
      json.find(R"("scene":0)"), 9,
      R"("scene":0,"extensionsUsed":["ACME_x"],"extensions":{"ACME_x":{"a":[1,2.5,"\u00e9"]}},)"
      R"("extras":{"deep":[[[null,true,1e-30,-0.1]]]})");
  uint32_t json_size = 0;
  std::memcpy(&json_size, file.data() + 12, 4);
  file = make_glb_container(json, std::span(file).subspan(28 + json_size));
  const GltfSource source{file, {}};
  const auto bytes = written(source, load_gltf(source, {}));
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  EXPECT_NE(text.find(R"("extensions":{"ACME_x":{"a":[1,2.5,"é"]}})"), std::string::npos);
  EXPECT_NE(text.find(R"("extras":{"deep":[[[null,true,1e-30,-0.1]]]})"), std::string::npos);
}

TEST(WriteGlb, WrongNumberOfValuesIsOurMistake) {
  const auto file = make_glb(make_floor(1));
  const GltfSource source{file, {}};
  const Scene scene = load_gltf(source, {});
  const std::vector<float> values(3);
  const VertexAttribute attribute{"_AO", values};
  try {
    write_glb(source, scene, std::span(&attribute, 1), "");
    FAIL() << "written";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::internal);
  }
}
