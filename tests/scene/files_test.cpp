// Real files, against what others measured of them.

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/data.h"
#include "tests/support/gltf_files.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

struct Expected {
  const char* path;
  uint64_t triangles;  // as the file states them: kept, without area, and double
  uint64_t vertices;   // as flattened: of every primitive of triangles under every node
  Vec3d lower, upper;  // world space; both zero when there is nothing
  size_t lights = 0, textures = 0;
  uint64_t degenerate = 0, without_normals = 0, ignored = 0;
};

// Counts and bounds are the manifest's. Where its figures are of meshes rather than of the
// flattened scene, vertices are its count times the nodes that show it; where they ignore what a
// file does (skin, sparse values), the comment says what the file shows.
const Expected kScenes[] = {
    {"interior_hotel_room/hotel-room.decoded.glb",
     99029,
     107356 - 17930,
     {6791.5, -66.197, -11129.199},
     {13274.5, 2130.74, -1134.32},
     0,
     6,
     0,
     0,
     1},
    {"interior_hotel_room/hotel-room.meshopt.glb",
     99029,
     107356 - 17930,
     {6791.5, -66.197, -11129.199},
     {13274.5, 2130.74, -1134.32},
     0,
     6,
     0,
     0,
     1},
    {"interior_volumetric_room/VolumetricFogExample.glb",
     360,
     456,
     {-3.16, 0.016, -6.742},
     {3.16, 6.322, 6.742},
     1},
    {"cornell_box/CornellBox.glb", 36, 74, {-556, 0, -559.2}, {0, 548.8, 0}},
    {"irradiance_volume/IrradianceVolumeExample.glb",
     32,
     64,
     {-20.2, -0.923, -20.2},
     {20.352, 0, 20.503}},
    {"reflection_probe_cubes/Cubes.glb",
     36,
     72,
     {-4.284, -1.938, -2.994},
     {4.603, 3.591, 3.639},
     1},
    {"outdoor_bridge_garden/japanese-bridge-garden.decoded.glb",
     21883,
     41980,
     {-5.527, 0.377, -5.265},
     {5.833, 7.39, 6.101}},
    {"outdoor_bridge_garden/japanese-bridge-garden.meshopt.glb",
     21883,
     41980,
     {-5.527, 0.377, -5.265},
     {5.833, 7.39, 6.101}},
    {"outdoor_mountains/Mountains.gltf", 25600, 2 * 6561, {-1, -0.086, -1}, {1.002, 0.249, 1.006}},
    {"lantern/Lantern.gltf", 5394, 4145, {-3.922, 0.184, -2.316}, {11.569, 25.848, 2.316}, 0, 2},
    {"alpha_mask_bike/vino-bike.decoded.glb",
     95598,
     61057,
     {-0.34, -1.15, -0.817},
     {0.34, 0.011, 0.799},
     0,
     2},
    {"degenerate_engine/2CylinderEngine.glb",
     121496,
     84657,
     {-371.692, -180.972, -140},
     {371.692, 92.042, 128},
     0,
     0,
     11160},
    {"fox_skin_no_normals/Fox.glb",
     576,
     1728,
     {-12.593, -0.122, -88.095},
     {12.593, 78.907, 66.625},
     0,
     1,
     0,
     1},
    {"small_features/vertex_color_test/VertexColorTest.gltf",
     36,
     72,
     {-1, -1, -0.013},
     {1, 1, 0.061},
     0,
     2},
    {"small_features/pos_color_sphere/test_pos_color.gltf",
     224,
     114,
     {-1, -1, -1},
     {1, 1, 1},
     0,
     0,
     0,
     1},
    {"small_features/sphere_four_lights/sphere_lights.gltf",
     224,
     231,
     {-1, -1, -1},
     {1, 1, 1},
     4,
     1},
    {"small_features/light_no_normals_foreign_ext/issue-261.gltf",
     12,
     8,
     {-0.5, -0.5, -0.5},
     {0.5, 0.5, 0.5},
     1,
     0,
     0,
     1},
    // The sparse values lift three vertices, one of them to y = 4.
    {"small_features/simple_sparse_accessor/SimpleSparseAccessor.gltf",
     12,
     14,
     {0, 0, 0},
     {6, 4, 0},
     0,
     0,
     0,
     1},
    // The skin moves the strip of x in [0, 1] half a unit to the left.
    {"small_features/simple_skin/SimpleSkin.gltf", 8, 10, {-0.5, 0, 0}, {0.5, 2, 0}, 0, 0, 0, 1},
    {"small_features/animated_morph_cube/AnimatedMorphCube.gltf", 12, 24, {-1, -1, -1}, {1, 1, 1}},
    {"small_features/texture_transform/TextureTransformTest.gltf",
     24,
     48,
     {-1.6, -1.141, 0},
     {1.6, 1.05, 0.01},
     0,
     5,
     0,
     12},
    {"small_features/unlit_test/UnlitTest.gltf", 88, 192, {-2.2, -1, -1}, {2.2, 1, 1}},
    {"small_features/mirrored_triangle/one_face_123_mirror.gltf",
     1,
     3,
     {-3, -0.11, 0},
     {-1, -0.01, 0},
     0,
     0,
     0,
     1},
    {"small_features/draco/Box.glb", 12, 24, {-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}},
    {"small_features/draco/Box_Draco.glb", 12, 24, {-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}},
    {"small_features/draco/suzi.draco.glb",
     14842,
     7503,
     {-0.93, -0.67, -0.545},
     {0.93, 0.668, 0.576}},
    {"small_features/meshopt_quantized/pirate.glb",
     5010,
     2887,
     {-0.761, -0.001, -0.229},
     {0.761, 1.904, 0.226}},
    {"small_features/uri_with_spaces/CubeImageUriMultipleSpaces.gltf",
     12,
     24,
     {-0.5, -0.5, -0.5},
     {0.5, 0.5, 0.5},
     0,
     1},
    {"small_features/uri_with_spaces/CubeImageUriSpaces.gltf",
     12,
     24,
     {-0.5, -0.5, -0.5},
     {0.5, 0.5, 0.5},
     0,
     1},
};

void expect_near(const Vec3d& a, const Vec3d& b, double tolerance) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], tolerance) << "axis " << axis;
}

void expect_sound(const Scene& scene) {
  for (const SurfaceMesh& mesh : scene.meshes) {
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    ASSERT_GE(mesh.material, 0);
    ASSERT_LT(static_cast<size_t>(mesh.material), scene.materials.size());
    for (const Vec3& n : mesh.normals) ASSERT_NEAR(length(n), 1, 1e-5);
    for (const Vec3& p : mesh.positions) ASSERT_TRUE(is_finite(p));
    for (const auto& t : mesh.triangles) {
      for (const uint32_t i : t) ASSERT_LT(i, mesh.positions.size());
    }
  }
}

}  // namespace

TEST(SceneFiles, LoadWithTheCountsAndBoundsOfTheManifest) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const Expected& expected : kScenes) {
    SCOPED_TRACE(expected.path);
    const GltfFiles files = read_gltf_files(data / "scenes" / expected.path);
    const Scene scene = load_gltf(files.source(), {});
    const SceneReport& report = scene.report;
    EXPECT_EQ(
        report.triangles + report.dropped_degenerate_triangles + report.dropped_duplicate_triangles,
        expected.triangles);
    EXPECT_EQ(report.vertices, expected.vertices);
    EXPECT_EQ(report.dropped_degenerate_triangles, expected.degenerate);
    EXPECT_EQ(report.meshes_without_normals, expected.without_normals);
    EXPECT_EQ(report.ignored_points_and_lines, expected.ignored);
    EXPECT_EQ(report.dropped_broken_triangles, 0u);
    EXPECT_EQ(scene.lights.size(), expected.lights);
    EXPECT_EQ(scene.textures.size(), expected.textures);
    // The manifest prints three decimals.
    const Bounds world = world_bounds(scene);
    expect_near(world.lower, expected.lower, 6e-4);
    expect_near(world.upper, expected.upper, 6e-4);
    expect_sound(scene);
  }
}

TEST(SceneFiles, EveryPrimitiveModeGivesItsTriangles) {
  LIGHTKILN_NEEDS_DATA(data);
  for (int i = 0; i < 16; ++i) {
    const std::string name =
        std::string("Mesh_PrimitiveMode_") + (i < 10 ? "0" : "") + std::to_string(i) + ".gltf";
    SCOPED_TRACE(name);
    const GltfFiles files = read_gltf_files(data / "scenes/small_features/primitive_modes" / name);
    const Scene scene = load_gltf(files.source(), {});
    const bool surface = (i >= 4 && i <= 6) || i >= 11;
    EXPECT_EQ(scene.report.triangles, surface ? 2u : 0u);
    EXPECT_EQ(scene.report.ignored_points_and_lines, surface ? 0u : 1u);
    EXPECT_EQ(scene.meshes.size(), surface ? 1u : 0u);
    EXPECT_EQ(scene.bounds.empty(), !surface);
    if (!surface) continue;
    // The square [-0.5, 0.5]^2 whole, facing +Z, in every mode and index size.
    const Bounds world = world_bounds(scene);
    expect_near(world.lower, {-0.5, -0.5, 0}, 1e-6);
    expect_near(world.upper, {0.5, 0.5, 0}, 1e-6);
    for (const Vec3& n : scene.meshes[0].normals) EXPECT_EQ(n, (Vec3{0, 0, 1}));
    EXPECT_EQ(scene.report.open_edges, 4u);
    EXPECT_EQ(scene.report.inconsistent_edges, 0u);
  }
}

TEST(SceneFiles, SecondParentIsRefusedByName) {
  LIGHTKILN_NEEDS_DATA(data);
  const GltfFiles files =
      read_gltf_files(data / "scenes/small_features/scaled_instances/cube_att.gltf");
  try {
    load_gltf(files.source(), {});
    FAIL() << "loaded";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_input);
    EXPECT_NE(std::string(error.what()).find("NODE_PARENT_OVERRIDE"), std::string::npos);
    EXPECT_EQ(error.where(), "/nodes/2/children/0");
  }
}

// The same scene, compressed and not: positions within a grid step of its quantisation.
static void expect_same_geometry(const Scene& a, const Scene& b, double tolerance) {
  ASSERT_EQ(a.meshes.size(), b.meshes.size());
  for (size_t m = 0; m < a.meshes.size(); ++m) {
    ASSERT_EQ(a.meshes[m].positions.size(), b.meshes[m].positions.size());
    ASSERT_EQ(a.meshes[m].triangles, b.meshes[m].triangles);
    for (size_t i = 0; i < a.meshes[m].positions.size(); ++i) {
      const Vec3d p = a.normalisation.to_world(to_double(a.meshes[m].positions[i]));
      const Vec3d q = b.normalisation.to_world(to_double(b.meshes[m].positions[i]));
      ASSERT_LE(length(p - q), tolerance);
      ASSERT_GE(dot(a.meshes[m].normals[i], b.meshes[m].normals[i]), 0.9999f);
    }
  }
}

TEST(SceneFiles, MeshoptAndPlainVariantsAreTheSameScene) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* stem :
       {"interior_hotel_room/hotel-room", "outdoor_bridge_garden/japanese-bridge-garden"}) {
    const GltfFiles packed =
        read_gltf_files(data / "scenes" / (std::string(stem) + ".meshopt.glb"));
    const GltfFiles plain = read_gltf_files(data / "scenes" / (std::string(stem) + ".decoded.glb"));
    GltfLoadOptions options;
    options.textures = false;
    // Both hold the same quantised integers, so nothing may differ.
    expect_same_geometry(load_gltf(packed.source(), options), load_gltf(plain.source(), options),
                         0);
  }
}

TEST(SceneFiles, DracoBoxIsThePlainBox) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto folder = data / "scenes/small_features/draco";
  const Scene packed = load_gltf(read_gltf_files(folder / "Box_Draco.glb").source(), {});
  const Scene plain = load_gltf(read_gltf_files(folder / "Box.glb").source(), {});
  // Draco reorders vertices, so faces are compared: each corner of one box is a corner of the
  // other.
  ASSERT_EQ(packed.meshes[0].positions.size(), plain.meshes[0].positions.size());
  EXPECT_EQ(packed.report.open_edges, 0u);
  EXPECT_EQ(packed.report.inconsistent_edges, 0u);
  for (size_t i = 0; i < packed.meshes[0].positions.size(); ++i) {
    bool found = false;
    for (size_t k = 0; k < plain.meshes[0].positions.size() && !found; ++k) {
      // 11 or 14 bits over an extent of one: a step of at most 5e-4.
      found = length(packed.meshes[0].positions[i] - plain.meshes[0].positions[k]) < 5e-4f &&
              dot(packed.meshes[0].normals[i], plain.meshes[0].normals[k]) > 0.999f;
    }
    EXPECT_TRUE(found) << "vertex " << i;
  }
}

TEST(SceneFiles, LightsStandWhereTheirNodesPutThem) {
  LIGHTKILN_NEEDS_DATA(data);
  const GltfFiles files =
      read_gltf_files(data / "scenes/small_features/sphere_four_lights/sphere_lights.gltf");
  const Scene scene = load_gltf(files.source(), {});
  ASSERT_EQ(scene.lights.size(), 4u);
  const auto count = [&](LightKind kind) {
    return std::count_if(scene.lights.begin(), scene.lights.end(),
                         [&](const PunctualLight& light) { return light.kind == kind; });
  };
  EXPECT_EQ(count(LightKind::spot), 2);
  EXPECT_EQ(count(LightKind::point), 1);
  EXPECT_EQ(count(LightKind::directional), 1);
  bool default_cone = false;
  for (const PunctualLight& light : scene.lights) {
    EXPECT_NEAR(length(light.direction), 1, 1e-9);
    if (light.kind == LightKind::spot && light.inner_cone_rad == 0) {
      default_cone = default_cone || std::abs(light.outer_cone_rad - kPi / 4) < 1e-9;
    }
  }
  EXPECT_TRUE(default_cone);
}
