// The hard cases of geometry, as far as loading decides them. Each has its positive control: the
// same scene with the treatment off, or the fault absent.

#include <cstring>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/scene/gltf.h"
#include "core/scene/mesh_topology.h"
#include "core/scene/normals.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/gltf_files.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

Scene load(const MeshData& mesh) {
  const auto file = make_glb(mesh);
  return load_gltf({file, {}}, {});
}

bool same_geometry(const Scene& a, const Scene& b) {
  if (a.meshes.size() != b.meshes.size()) return false;
  for (size_t m = 0; m < a.meshes.size(); ++m) {
    const SurfaceMesh &x = a.meshes[m], &y = b.meshes[m];
    if (x.positions != y.positions || x.normals != y.normals || x.triangles != y.triangles) {
      return false;
    }
  }
  return a.bounds.lower == b.bounds.lower && a.bounds.upper == b.bounds.upper;
}

Vec3 vertex(float value) {
  return {value, value, value};
}

}  // namespace

// --- Scale and place -----------------------------------------------------------------------------

TEST(Normalising, PowersOfTwoOfScaleGiveTheSameBytes) {
  const MeshData mesh = make_sphere({0.3f, -0.7f, 1.9f}, 1.3f);
  const Scene one = load(mesh);
  for (const int exponent : {-40, -20, 20, 40}) {
    const Scene other = load(scaled(mesh, std::ldexp(1.0f, exponent)));
    EXPECT_TRUE(same_geometry(one, other)) << exponent;
    EXPECT_EQ(other.normalisation.exponent, one.normalisation.exponent - exponent);
  }
  // The control: a scale that is no power of two rounds differently.
  EXPECT_FALSE(same_geometry(one, load(scaled(mesh, 3.0f))));
}

TEST(Normalising, FarOffDyadicVerticesGiveTheSameBytes) {
  MeshData mesh = make_box({0, 0, 0}, {1.5f, 2.25f, 0.75f});
  mesh = merged(mesh, translated(make_box({0, 0, 0}, {1, 1, 1}), {3.015625f, 0, -2}));
  const Scene near = load(mesh);
  EXPECT_TRUE(same_geometry(near, load(translated(mesh, {65536, -65536, 65536}))));
  // The control: off the grid of 2^-6 the float coordinates themselves are rounded out there.
  const MeshData third = make_box({0, 0, 0}, {1 / 3.0f, 1, 1});
  EXPECT_FALSE(same_geometry(load(third), load(translated(third, {65536, 0, 0}))));
}

TEST(Normalising, ANodeFarAwayCostsNoPrecision) {
  SceneData data;
  const MeshData ball = make_sphere({0, 0, 0}, 1);
  data.parts.push_back(
      {ball, {}, std::array<double, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1e7, -1e7, 1e7, 1}});
  const auto file = make_glb(data);
  const Scene scene = load_gltf({file, {}}, {});
  const Scene home = load(ball);
  for (size_t i = 0; i < ball.positions.size(); ++i) {
    EXPECT_NEAR(length(scene.meshes[0].positions[i] - home.meshes[0].positions[i]), 0, 1e-7);
  }
  // The control: the same offset inside float coordinates loses everything below half a unit.
  const Scene rounded = load(translated(ball, {1e7f, -1e7f, 1e7f}));
  EXPECT_LT(rounded.report.triangles, scene.report.triangles);
}

// --- Bad vertices and triangles ------------------------------------------------------------------

TEST(Cleanup, BadVerticesAndTrianglesAreCountedAndLeaveTheRestUntouched) {
  const MeshData good = make_sphere({0, 0, 0}, 1, 16, 32);
  MeshData bad = good;
  const auto first = static_cast<uint32_t>(bad.positions.size());
  Vec3 infinite{1, -INFINITY, 0};
  for (const Vec3& p :
       {Vec3{0, NAN, 0}, infinite, vertex(3e38f), vertex(0.5f), vertex(0.25f), vertex(0.75f)}) {
    bad.positions.push_back(p);
    bad.normals.push_back({0, 1, 0});
    bad.texcoords.push_back({0, 0});
  }
  bad.triangles.push_back({first, 0, 1});
  bad.triangles.push_back({first + 1, 0, 1});
  bad.triangles.push_back({first + 2, 0, 1});
  bad.triangles.push_back({first + 3, first + 4, first + 5});  // collinear

  const Scene scene = load(bad);
  EXPECT_EQ(scene.report.dropped_nan_vertices, 1u);
  EXPECT_EQ(scene.report.dropped_infinite_vertices, 1u);
  EXPECT_EQ(scene.report.dropped_oversize_vertices, 1u);
  EXPECT_EQ(scene.report.dropped_degenerate_triangles, 1u);
  EXPECT_EQ(scene.report.dropped_broken_triangles, 3u);

  Scene clean = load(good);
  EXPECT_EQ(scene.meshes[0].triangles, clean.meshes[0].triangles);
  EXPECT_EQ(scene.bounds.lower, clean.bounds.lower);
  EXPECT_EQ(scene.bounds.upper, clean.bounds.upper);
  // Vertices keep the file's order and number; the dropped ones stand at the origin.
  ASSERT_EQ(scene.meshes[0].positions.size(), bad.positions.size());
  EXPECT_TRUE(std::equal(clean.meshes[0].positions.begin(), clean.meshes[0].positions.end(),
                         scene.meshes[0].positions.begin()));
  EXPECT_EQ(scene.meshes[0].positions[first], (Vec3{}));
  // The control: the good mesh reports nothing.
  EXPECT_EQ(clean.report.dropped_broken_triangles + clean.report.dropped_degenerate_triangles, 0u);
}

TEST(Cleanup, MoreThanOneBadVertexInAHundredIsRefused) {
  MeshData mesh = make_grid(1, 9);  // 100 vertices
  mesh.positions[50].x = NAN;
  EXPECT_EQ(load(mesh).report.dropped_nan_vertices, 1u);
  mesh.positions[51].y = INFINITY;
  EXPECT_THROW(load(mesh), Error);
}

TEST(Cleanup, TrianglesWithoutAreaAreDroppedAtAnyScaleAndAngle) {
  // Points on a line that no float grid is aligned with, under a rotation that rounds.
  for (const float scale : {1e-18f, 1.0f, 1e15f}) {
    MeshData mesh = without_normals(make_floor(1));
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const float t : {1.0f, 2.0f, 4.0f}) {
      mesh.positions.push_back({0.1f * t, 0.7f * t, -0.3f * t});
      mesh.texcoords.push_back({0, 0});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({0, 0, 1});
    SceneData data;
    const double c = std::cos(0.7), s = std::sin(0.7);
    data.parts.push_back({scaled(mesh, scale),
                          {},
                          std::array<double, 16>{c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
    const auto file = make_glb(data);
    const Scene scene = load_gltf({file, {}}, {});
    EXPECT_EQ(scene.report.triangles, 2u) << scale;
    EXPECT_EQ(scene.report.dropped_degenerate_triangles, 2u) << scale;
  }
}

TEST(Cleanup, SliversAreKept) {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0.5f, 1e-6f, 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(load(mesh).report.triangles, 1u);
}

TEST(Cleanup, ExactDuplicatesAreDroppedAcrossMeshes) {
  const MeshData box = make_box({0, 0, 0}, {1, 1, 1});
  SceneData data;
  data.parts.push_back({box, {}, {}});
  const auto single_file = make_glb(data);
  const Scene single = load_gltf({single_file, {}}, {});
  // One mesh that holds everything twice, the second time with corners turned round.
  MeshData twice = merged(box, box);
  for (size_t i = 12; i < 24; ++i) {
    auto& t = twice.triangles[i];
    t = {t[1], t[2], t[0]};
  }
  const Scene doubled = load(twice);
  EXPECT_EQ(doubled.report.dropped_duplicate_triangles, 12u);
  EXPECT_EQ(doubled.meshes[0].triangles, single.meshes[0].triangles);
  // The control: the other winding is another face, and so is one that lies elsewhere.
  const Scene both = load(merged(box, reversed(box)));
  EXPECT_EQ(both.report.dropped_duplicate_triangles, 0u);
  const Scene apart = load(merged(box, translated(box, {1e-3f, 0, 0})));
  EXPECT_EQ(apart.report.dropped_duplicate_triangles, 0u);
}

// --- Edges ---------------------------------------------------------------------------------------

TEST(Topology, ClosedMeshesHaveNoOpenEdgesHoweverTheyAreIndexed) {
  const Scene box = load(make_box({0, 0, 0}, {1, 2, 3}));  // 24 vertices, joined by position only
  EXPECT_EQ(box.report.open_edges, 0u);
  EXPECT_EQ(box.report.inconsistent_edges, 0u);
  // Five faces: the hole has four sides.
  MeshData open = make_box({0, 0, 0}, {1, 2, 3});
  open.triangles.resize(10);
  EXPECT_EQ(load(open).report.open_edges, 4u);
}

TEST(Topology, GapsBelowAMillionthAreWeldedAndLargerOnesReported) {
  const auto two_halves = [](float gap) {
    MeshData mesh = make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    mesh = merged(mesh, make_quad({1 + gap, 0, 0}, {1, 0, 0}, {0, 1, 0}));
    return load(mesh).report.open_edges;
  };
  EXPECT_EQ(two_halves(0), 6u);
  EXPECT_EQ(two_halves(1e-6f), 6u);
  EXPECT_EQ(two_halves(1e-4f), 8u);
}

TEST(Topology, WeldingDoesNotDependOnWhereTheGridLies) {
  // Pairs of points half a tolerance apart, at many offsets: cells must not separate any.
  std::vector<SurfaceMesh> meshes(2);
  for (int i = 0; i < 500; ++i) {
    const float x = -0.5f + 0.0017f * static_cast<float>(i);
    for (int side = 0; side < 2; ++side) {
      SurfaceMesh& mesh = meshes[static_cast<size_t>(side)];
      const auto first = static_cast<uint32_t>(mesh.positions.size());
      const float shift = side == 0 ? 0 : 5e-7f;
      mesh.positions.push_back({x + shift, 0, 0});
      mesh.positions.push_back({x + shift, 0.25f, 0});
      mesh.positions.push_back({x + shift, 0, side == 0 ? 0.25f : -0.25f});
      if (side == 0) mesh.triangles.push_back({first, first + 1, first + 2});
      if (side == 1) mesh.triangles.push_back({first + 1, first, first + 2});
    }
  }
  const EdgeCounts counts = count_edges(meshes, 1e-6);
  EXPECT_EQ(counts.open, 2000u);  // four free edges a pair; the fifth is shared
  EXPECT_EQ(counts.inconsistent, 0u);
  EXPECT_EQ(count_edges(meshes, 1e-7).open, 3000u);
}

TEST(Topology, InconsistentWindingIsCounted) {
  MeshData box = make_box({0, 0, 0}, {1, 1, 1});
  std::swap(box.triangles[0][1], box.triangles[0][2]);
  EXPECT_EQ(load(box).report.inconsistent_edges, 3u);
}

// --- Normals -------------------------------------------------------------------------------------

TEST(Cleanup, MissingNormalsOfFlatMeshesComeBackExactly) {
  const MeshData box = make_box({0, 0, 0}, {1, 2, 3});
  const Scene with = load(box);
  const Scene without = load(without_normals(box));
  EXPECT_EQ(with.report.meshes_without_normals, 0u);
  EXPECT_EQ(without.report.meshes_without_normals, 1u);
  for (size_t i = 0; i < box.positions.size(); ++i) {
    EXPECT_LE(length(with.meshes[0].normals[i] - without.meshes[0].normals[i]), 1e-6f);
  }
}

TEST(Cleanup, UnusableNormalsAreReplacedAndCounted) {
  MeshData box = make_box({0, 0, 0}, {1, 1, 1});
  box.normals[0] = {0, 0, 0};
  box.normals[5] = {NAN, 0, 1};
  box.normals[9] = {0, 7, 0};
  box.normals[12] = box.normals[12] * 1.005f;  // within what quantisation does
  const Scene scene = load(box);
  EXPECT_EQ(scene.report.repaired_normals, 3u);
  const Scene clean = load(make_box({0, 0, 0}, {1, 1, 1}));
  EXPECT_EQ(clean.report.repaired_normals, 0u);
  for (size_t i = 0; i < box.positions.size(); ++i) {
    EXPECT_NEAR(length(scene.meshes[0].normals[i] - clean.meshes[0].normals[i]), 0, 1e-6);
  }
}
