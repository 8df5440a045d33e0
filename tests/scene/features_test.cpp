// What a valid file may hold, one feature at a time, in files whose every byte is known.

#include <cstring>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/image/ldr.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_accessors.h"
#include "core/scene/gltf_pose.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/gltf_files.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

Scene load(const std::vector<std::byte>& file, const GltfLoadOptions& options = {}) {
  return load_gltf({file, {}}, options);
}

class Bin {
 public:
  template <typename T>
  size_t add(std::initializer_list<T> values) {
    while (bytes.size() % 4 != 0) bytes.push_back(std::byte{0});
    const size_t at = bytes.size();
    for (const T value : values) {
      bytes.resize(bytes.size() + sizeof value);
      std::memcpy(bytes.data() + bytes.size() - sizeof value, &value, sizeof value);
    }
    return at;
  }
  std::vector<std::byte> bytes;
};

// {"asset", views, accessors and one buffer}; `rest` continues the root object.
std::vector<std::byte> file_of(const Bin& bin, const std::string& views,
                               const std::string& accessors, const std::string& rest) {
  return make_glb_container(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":)" +
                                std::to_string(bin.bytes.size()) + R"(}],"bufferViews":[)" + views +
                                R"(],"accessors":[)" + accessors + "]," + rest + "}",
                            bin.bytes);
}

const std::string kShowMesh = R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)";

std::vector<float> read_single(const Bin& bin, const std::string& view,
                               const std::string& accessor) {
  const auto bytes = file_of(bin, view, accessor, R"("scene":0,"scenes":[{}])");
  const GltfSource source{bytes, {}};
  const GltfFile file = open_gltf(bytes, {});
  GltfBytes data(file, source);
  return read_floats({file, data}, 0);
}

Vec3d world_vertex(const Scene& scene, size_t mesh, size_t vertex) {
  return scene.normalisation.to_world(to_double(scene.meshes.at(mesh).positions.at(vertex)));
}

}  // namespace

// --- Accessors -----------------------------------------------------------------------------------

TEST(Accessors, EveryComponentTypeAndNormalisation) {
  struct Case {
    int type;
    bool normalized;
    std::vector<float> expected;
  };
  Bin bin;
  bin.add<uint8_t>({0, 127, 128, 255, 0, 0, 0, 128, 0, 0, 0x80, 0x3f});
  const std::string view = R"({"buffer":0,"byteLength":12})";
  const Case cases[] = {
      {5120, false, {0, 127, -128, -1}},
      {5120, true, {0, 1, -1, -1.0f / 127}},
      {5121, false, {0, 127, 128, 255}},
      {5121, true, {0, 127.0f / 255, 128.0f / 255, 1}},
      {5122, false, {32512, -128, 0, -32768}},
      {5122, true, {32512.0f / 32767, -128.0f / 32767, 0, -1}},
      {5123, false, {32512, 65408, 0, 32768}},
      {5123, true, {32512.0f / 65535, 65408.0f / 65535, 0, 32768.0f / 65535}},
      {5126, false, {-5.87774e-39f, -0.0f, 1}},
  };
  for (const Case& c : cases) {
    const std::string accessor = R"({"bufferView":0,"componentType":)" + std::to_string(c.type) +
                                 R"(,"count":)" + std::to_string(c.expected.size()) +
                                 R"(,"type":"SCALAR","normalized":)" +
                                 (c.normalized ? "true" : "false") + "}";
    const auto values = read_single(bin, view, accessor);
    ASSERT_EQ(values.size(), c.expected.size());
    for (size_t i = 0; i < values.size(); ++i) {
      if (c.type == 5126 && i == 0) continue;  // 0xff807f00 is a denormal or NaN pattern; not read
      EXPECT_FLOAT_EQ(values[i], c.expected[i]) << c.type << " element " << i;
    }
  }
}

TEST(Accessors, StrideAndOffsetAreFollowed) {
  Bin bin;
  bin.add<float>({9, 1, 2, 9, 9, 3, 4, 9, 9, 5, 6});
  const auto values =
      read_single(bin, R"({"buffer":0,"byteOffset":4,"byteLength":40,"byteStride":16})",
                  R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"})");
  EXPECT_EQ(values, (std::vector<float>{1, 2, 3, 4, 5, 6}));
}

TEST(Accessors, MatrixColumnsStartAtMultiplesOfFour) {
  Bin bin;
  bin.add<uint8_t>({1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0});
  const auto values =
      read_single(bin, R"({"buffer":0,"byteLength":12})",
                  R"({"bufferView":0,"componentType":5121,"count":1,"type":"MAT3"})");
  EXPECT_EQ(values, (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(Accessors, SparseValuesReplaceWithAndWithoutABase) {
  Bin bin;
  bin.add<float>({1, 2, 3, 4});
  bin.add<uint16_t>({1, 3});
  bin.add<float>({20, 40});
  const std::string views =
      R"({"buffer":0,"byteLength":16},{"buffer":0,"byteOffset":16,"byteLength":4},)"
      R"({"buffer":0,"byteOffset":20,"byteLength":8})";
  const std::string sparse =
      R"("componentType":5126,"count":4,"type":"SCALAR","sparse":{"count":2,)"
      R"("indices":{"bufferView":1,"componentType":5123},"values":{"bufferView":2}}})";
  EXPECT_EQ(read_single(bin, views, R"({"bufferView":0,)" + sparse),
            (std::vector<float>{1, 20, 3, 40}));
  EXPECT_EQ(read_single(bin, views, "{" + sparse), (std::vector<float>{0, 20, 0, 40}));
}

TEST(Accessors, QuantisedPositionsNeedTheirExtension) {
  Bin bin;
  bin.add<int16_t>({0, 0, 0, 0, 100, 0, 0, 0, 0, 100, 0, 0});
  const std::string view = R"({"buffer":0,"byteLength":24,"byteStride":8})";
  const std::string accessor = R"({"bufferView":0,"componentType":5122,"count":3,"type":"VEC3"})";
  const std::string mesh =
      kShowMesh + R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])";
  const Scene scene =
      load(file_of(bin, view, accessor, R"("extensionsUsed":["KHR_mesh_quantization"],)" + mesh));
  EXPECT_EQ(world_bounds(scene).upper, (Vec3d{100, 100, 0}));
  EXPECT_THROW(load(file_of(bin, view, accessor, mesh)), Error);
}

// --- Nodes ---------------------------------------------------------------------------------------

TEST(Nodes, HierarchyOfMatricesAndTrsIsComposed) {
  Bin bin;
  bin.add<float>({1, 0, 0, 0, 1, 0, 0, 0, 1});
  // Parent: translate (10, 0, 0) after a quarter turn about +Z; child: scale (2, 3, 4).
  const auto file = file_of(
      bin, R"({"buffer":0,"byteLength":36})",
      R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})",
      R"("scenes":[{"nodes":[1]}],"nodes":[{"mesh":0,"scale":[2,3,4]},)"
      R"({"children":[0],"translation":[10,0,0],"rotation":[0,0,0.70710678118,0.70710678118]}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])");
  const Scene scene = load(file);
  EXPECT_NEAR(length(world_vertex(scene, 0, 0) - Vec3d{10, 2, 0}), 0, 1e-6);
  EXPECT_NEAR(length(world_vertex(scene, 0, 1) - Vec3d{7, 0, 0}), 0, 1e-6);
  EXPECT_NEAR(length(world_vertex(scene, 0, 2) - Vec3d{10, 0, 4}), 0, 1e-6);
}

TEST(Nodes, MirroringTurnsTheWindingSoThatOutsideStaysOutside) {
  for (const double sign : {1.0, -1.0}) {
    SceneData data;
    data.parts.push_back(
        {make_box({0, 0, 0}, {1, 1, 1}),
         {},
         std::array<double, 16>{sign, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 5, 6, 7, 1}});
    const Scene scene = load(make_glb(data));
    const SurfaceMesh& mesh = scene.meshes.at(0);
    double volume = 0;
    for (const auto& t : mesh.triangles) {
      const Vec3d a = to_double(mesh.positions[t[0]]), b = to_double(mesh.positions[t[1]]),
                  c = to_double(mesh.positions[t[2]]);
      volume += dot(a, cross(b, c)) / 6;
      EXPECT_GT(dot(cross(b - a, c - a), to_double(mesh.normals[t[0]])), 0);
    }
    EXPECT_NEAR(volume / std::pow(scene.normalisation.scale(), 3), 6, 1e-5);
    EXPECT_EQ(scene.report.inconsistent_edges, 0u);
  }
}

TEST(Nodes, NormalsFollowTheInverseTransposeUnderShear) {
  Affine shear;
  shear.linear[0][1] = 2;  // x += 2 y
  // The plane x = 0 becomes the plane x = 2 y.
  const Vec3d n = transformed_normal(shear, {1, 0, 0});
  EXPECT_NEAR(length(n - normalize(Vec3d{1, -2, 0})), 0, 1e-12);
}

TEST(Nodes, FlattenedMeshIsDroppedAloud) {
  SceneData data;
  data.parts.push_back({make_box({0, 0, 0}, {1, 1, 1}),
                        {},
                        std::array<double, 16>{1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  data.parts.push_back({make_floor(1), {}, {}});
  const Scene scene = load(make_glb(data));
  EXPECT_EQ(scene.report.triangles, 2u);
  EXPECT_EQ(scene.report.dropped_degenerate_triangles, 12u);
  EXPECT_FALSE(scene.report.warnings.empty());
  EXPECT_EQ(scene.meshes.at(0).positions.size(), 24u);  // attributes still line up with the file
}

TEST(Nodes, DefaultSceneRules) {
  const auto with = [](const std::string& scenes) {
    Bin bin;
    bin.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0});
    return load(file_of(bin, R"({"buffer":0,"byteLength":36})",
                        R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})",
                        scenes + R"("nodes":[{"mesh":0},{"mesh":0}],)"
                                 R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])"));
  };
  EXPECT_EQ(with(R"("scene":1,"scenes":[{"nodes":[0]},{"nodes":[0,1]}],)").meshes.size(), 2u);
  EXPECT_EQ(with(R"("scenes":[{"nodes":[0]},{"nodes":[0,1]}],)").meshes.size(), 1u);
  EXPECT_TRUE(with("").meshes.empty());
  EXPECT_TRUE(with(R"("scenes":[{}],)").bounds.empty());
  EXPECT_THROW(with(R"("scene":2,"scenes":[{"nodes":[0]}],)"), Error);
  EXPECT_THROW(with(R"("scenes":[{"nodes":[0,0]}],)"), Error);
}

// --- Skins and morphs ----------------------------------------------------------------------------

// A triangle of which two vertices follow joint 1 (node 1, moved by `x`) and one is shared half and
// half with joint 0 (node 2, at rest).
static std::vector<std::byte> skinned_triangle(const std::string& x, const std::string& mesh_node) {
  Bin bin;
  bin.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const size_t joints = bin.add<uint8_t>({0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const size_t weights = bin.add<float>({0.5f, 0.5f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const auto view = [](size_t offset, size_t size) {
    return R"({"buffer":0,"byteOffset":)" + std::to_string(offset) + R"(,"byteLength":)" +
           std::to_string(size) + "}";
  };
  return file_of(
      bin, view(0, 36) + "," + view(joints, 12) + "," + view(weights, 48),
      R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
      R"({"bufferView":1,"componentType":5121,"count":3,"type":"VEC4"},)"
      R"({"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"})",
      R"("scenes":[{"nodes":[0,1,2]}],"nodes":[{"mesh":0,"skin":0)" + mesh_node +
          R"(},{"translation":[)" + x +
          R"(,0,0]},{}],"skins":[{"joints":[2,1]}],)"
          R"("meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}]}])");
}

TEST(Skins, VerticesStandWhereTheJointsHoldThem) {
  const Scene scene = load(skinned_triangle("4", R"(,"translation":[100,0,0])"));
  // The mesh node's own translation is ignored, as the specification says.
  EXPECT_NEAR(length(world_vertex(scene, 0, 0) - Vec3d{2, 0, 0}), 0, 1e-6);
  EXPECT_NEAR(length(world_vertex(scene, 0, 1) - Vec3d{5, 0, 0}), 0, 1e-6);
  EXPECT_NEAR(length(world_vertex(scene, 0, 2) - Vec3d{4, 1, 0}), 0, 1e-6);
  EXPECT_FALSE(scene.report.warnings.empty());
}

TEST(Morphs, DefaultWeightsOfNodeGoBeforeThoseOfTheMesh) {
  const auto with = [](const std::string& node, const std::string& mesh) {
    Bin bin;
    bin.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0});
    bin.add<float>({0, 0, 8, 0, 0, 8, 0, 0, 8});
    return load(
        file_of(bin, R"({"buffer":0,"byteLength":72})",
                R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
                R"({"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"})",
                R"("scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)" + node +
                    R"(}],"meshes":[{"primitives":)"
                    R"([{"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}])" +
                    mesh + "}]"));
  };
  EXPECT_EQ(world_vertex(with("", ""), 0, 0).z, 0);
  EXPECT_EQ(world_vertex(with("", R"(,"weights":[0.5])"), 0, 0).z, 4);
  EXPECT_EQ(world_vertex(with(R"(,"weights":[0.25])", R"(,"weights":[0.5])"), 0, 0).z, 2);
  EXPECT_THROW(with("", R"(,"weights":[0.5,1])"), Error);
}

// --- Materials, textures, lights -----------------------------------------------------------------

TEST(Materials, AreReadWithTheirExtensions) {
  Image8 image{2, 1, 4, {255, 0, 0, 255, 0, 255, 0, 128}};
  SceneData data;
  Material material;
  material.base_color = {0.25f, 0.5f, 0.75f};
  material.alpha = 0.5f;
  material.alpha_mode = AlphaMode::mask;
  material.alpha_cutoff = 0.125f;
  material.emissive = {8, 4, 2};
  material.double_sided = true;
  material.unlit = true;
  material.metallic = 0.5f;
  material.roughness = 0.25f;
  material.base_color_texture.texture = 0;
  data.parts.push_back({make_floor(1), material, {}});
  data.images.push_back(write_png(image));
  const auto bytes = make_glb(data);
  const Scene scene = load(bytes);
  const Material& read = scene.materials.at(static_cast<size_t>(scene.meshes.at(0).material));
  EXPECT_EQ(read.base_color, material.base_color);
  EXPECT_EQ(read.alpha, material.alpha);
  EXPECT_EQ(read.alpha_mode, AlphaMode::mask);
  EXPECT_EQ(read.alpha_cutoff, material.alpha_cutoff);
  EXPECT_NEAR(length(read.emissive - material.emissive), 0, 1e-5);
  EXPECT_TRUE(read.double_sided);
  EXPECT_TRUE(read.unlit);
  EXPECT_EQ(read.metallic, 0.5f);
  EXPECT_EQ(read.roughness, 0.25f);
  ASSERT_EQ(read.base_color_texture.texture, 0);
  EXPECT_EQ(scene.textures.at(0).rgba, image.pixels);

  GltfLoadOptions options;
  options.textures = false;
  const Scene bare = load(bytes, options);
  ASSERT_EQ(bare.textures.size(), 1u);
  EXPECT_EQ(bare.textures[0].width, 0);
  EXPECT_TRUE(bare.textures[0].rgba.empty());

  options.textures = true;
  options.limits.max_texels = 1;
  EXPECT_THROW(load(bytes, options), Error);
}

TEST(Materials, DamagedImageIsRefusedWithItsPlace) {
  SceneData data;
  Material material;
  material.emissive_texture.texture = 0;
  material.emissive = {1, 1, 1};
  data.parts.push_back({make_floor(1), material, {}});
  data.images.push_back(std::vector<std::byte>(40, std::byte{'P'}));
  try {
    load(make_glb(data));
    FAIL() << "loaded";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "/images/0");
  }
}

TEST(Materials, TextureTransformIsRead) {
  Bin bin;
  bin.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const size_t png = bin.bytes.size();
  const auto image = write_png({1, 1, 4, {1, 2, 3, 4}});
  bin.bytes.insert(bin.bytes.end(), image.begin(), image.end());
  const auto file = file_of(
      bin,
      R"({"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":)" + std::to_string(png) +
          R"(,"byteLength":)" + std::to_string(image.size()) + "}",
      R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})",
      kShowMesh +
          R"("images":[{"bufferView":1,"mimeType":"image/png"}],"samplers":[{"wrapS":33071,)"
          R"("wrapT":33648,"magFilter":9728}],"textures":[{"source":0,"sampler":0}],)"
          R"("materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":0,)"
          R"("extensions":{"KHR_texture_transform":{"offset":[0.5,0.25],"rotation":1.5,)"
          R"("scale":[2,3],"texCoord":1}}}}}],)"
          R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}])");
  const Scene scene = load(file);
  const TextureSlot& slot = scene.materials.at(0).base_color_texture;
  EXPECT_EQ(slot.texcoord, 1);
  EXPECT_EQ(slot.offset, (Vec2{0.5f, 0.25f}));
  EXPECT_EQ(slot.scale, (Vec2{2, 3}));
  EXPECT_EQ(slot.rotation_rad, 1.5f);
  const Texture& texture = scene.textures.at(0);
  EXPECT_EQ(texture.wrap_s, WrapMode::clamp);
  EXPECT_EQ(texture.wrap_t, WrapMode::mirrored_repeat);
  EXPECT_TRUE(texture.nearest);
  // The mesh has no second set of coordinates, and that is said.
  EXPECT_FALSE(scene.report.warnings.empty());
}

TEST(Materials, MeshWithoutMaterialGetsTheDefaultOne) {
  Bin bin;
  bin.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const Scene scene =
      load(file_of(bin, R"({"buffer":0,"byteLength":36})",
                   R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})",
                   kShowMesh + R"("materials":[{"doubleSided":true}],)"
                               R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])"));
  ASSERT_EQ(scene.materials.size(), 2u);
  EXPECT_EQ(scene.meshes.at(0).material, 1);
  EXPECT_FALSE(scene.materials[1].double_sided);
}

TEST(Lights, EveryTypeIsPlacedInTheWorld) {
  SceneData data;
  PunctualLight sun{"", LightKind::directional, {1, 0.5f, 0.25f}, {}, {0, -1, 0}, 0, 0, 0.7};
  PunctualLight bulb{"", LightKind::point, {100, 100, 100}, {1, 2, 3}, {0, 0, -1}, 12, 0, 0.7};
  PunctualLight spot{
      "", LightKind::spot, {5, 6, 7}, {-4, 5, 6}, normalize(Vec3d{1, 2, 2}), 0.0, 0.25, 0.5};
  data.lights = {sun, bulb, spot};
  data.parts.push_back({make_floor(1), {}, {}});
  const Scene scene = load(make_glb(data));
  ASSERT_EQ(scene.lights.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const PunctualLight& read = scene.lights[i];
    const PunctualLight& made = data.lights[i];
    EXPECT_EQ(read.kind, made.kind);
    EXPECT_EQ(read.intensity, made.intensity);
    EXPECT_NEAR(length(read.position - made.position), 0, 1e-6);
    if (made.kind != LightKind::point) {
      EXPECT_NEAR(length(read.direction - made.direction), 0, 1e-6);
    }
    EXPECT_EQ(read.range, made.range);
  }
  EXPECT_EQ(scene.lights[2].inner_cone_rad, 0.25);
  EXPECT_EQ(scene.lights[2].outer_cone_rad, 0.5);
}

// --- The two ways to make a scene ----------------------------------------------------------------

TEST(Builder, MakesTheSceneThatTheLoaderReads) {
  SceneData data;
  data.parts.push_back({make_box({-1, 0, 2}, {3, 4, 5}), {}, {}});
  data.parts.push_back({without_normals(make_sphere({7, 8, 9}, 2, 6, 8)),
                        {},
                        std::array<double, 16>{0, 2, 0, 0, -3, 0, 0, 0, 0, 0, -1, 0, 1, 2, 3, 1}});
  const Scene made = make_scene(data);
  const Scene read = load(make_glb(data));
  EXPECT_EQ(made.normalisation.exponent, read.normalisation.exponent);
  EXPECT_EQ(made.normalisation.centre, read.normalisation.centre);
  ASSERT_EQ(made.meshes.size(), read.meshes.size());
  for (size_t m = 0; m < made.meshes.size(); ++m) {
    EXPECT_EQ(made.meshes[m].positions, read.meshes[m].positions);
    EXPECT_EQ(made.meshes[m].triangles, read.meshes[m].triangles);
    for (size_t i = 0; i < made.meshes[m].normals.size(); ++i) {
      EXPECT_NEAR(length(made.meshes[m].normals[i] - read.meshes[m].normals[i]), 0, 1e-6);
    }
  }
  EXPECT_EQ(made.bounds.lower, read.bounds.lower);
  EXPECT_EQ(made.bounds.upper, read.bounds.upper);
}
