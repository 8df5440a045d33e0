// Ambient occlusion through the front door: a GLB goes in, bytes come out.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/image/ldr.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln {
namespace {

using test::make_box;
using test::make_glb;
using test::make_sphere;
using test::merged;
using test::MeshData;

const std::string kDigest = "sha256:" + std::string(64, '0');

Spec order(double target = 0.02) {
  Spec spec;
  spec.scene = InputRef{kDigest, {}};
  spec.parameters = AmbientOcclusionParameters{};
  spec.accuracy.target_error = target;
  return spec;
}
AmbientOcclusionParameters& parameters(Spec& spec) {
  return std::get<AmbientOcclusionParameters>(spec.parameters);
}

struct Baked {
  Plan plan;
  std::vector<std::byte> bytes;  // of all chunks, joined
  std::vector<float> openness, errors;
  Assembly assembly;

  const AoDocument& document() const { return std::get<AoDocument>(assembly.document); }
};

// `chunks` = 0 takes the plan's own.
Baked bake(const std::vector<std::byte>& glb, const Spec& spec, int threads = 1,
           uint64_t chunks = 0) {
  Inputs inputs;
  inputs.blobs[kDigest] = glb;
  Grants grants;
  grants.threads = threads;
  Progress progress;
  Bake front_door(spec, inputs, grants);
  Baked baked;
  baked.plan = front_door.plan(progress);
  if (chunks > 0) {
    baked.plan.chunks.clear();
    for (uint64_t i = 0; i < chunks; ++i) {
      const uint64_t first = baked.plan.elements * i / chunks;
      baked.plan.chunks.push_back({first, baked.plan.elements * (i + 1) / chunks - first});
    }
  }
  std::vector<ChunkResult> results;
  for (const ElementRange& range : baked.plan.chunks) {
    results.push_back(front_door.chunk(baked.plan, range, progress));
    const std::vector<std::byte>& bytes = results.back().bytes;
    baked.bytes.insert(baked.bytes.end(), bytes.begin(), bytes.end());
  }
  baked.assembly = front_door.assemble(baked.plan, results, progress);
  for (size_t at = 0; at + 16 <= baked.bytes.size(); at += 16) {
    float values[2];
    std::memcpy(values, baked.bytes.data() + at, sizeof values);
    baked.openness.push_back(values[0]);
    baked.errors.push_back(values[1]);
  }
  return baked;
}
Baked bake(const MeshData& mesh, const Spec& spec, int threads = 1, uint64_t chunks = 0) {
  return bake(make_glb(mesh), spec, threads, chunks);
}

// A floor with a sphere and a box on it: every kind of vertex.
MeshData still_life() {
  MeshData mesh = test::make_grid(4, 12);
  mesh = merged(mesh, make_sphere({-1, 1, 0}, 1, 12, 24));
  return merged(mesh, make_box({1, 0, -1}, {2, 2, 1}));
}

const Effect& effect(const Plan& plan, const std::string& name) {
  for (const Effect& e : plan.effects)
    if (e.name == name) return e;
  throw std::runtime_error("no effect " + name);
}

TEST(AmbientOcclusion, ConvexSolidsAreExactlyOpenAtEveryScale) {  // A1, G3
  for (const float radius : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e7f})
    for (const float centre : {0.0f, 1.0f, 1e5f}) {
      if (radius < 1e-5f * centre) continue;  // float cannot hold the shape
      const Vec3 c{centre, -centre, centre};
      const Vec3 r{radius, radius, radius};
      std::vector<MeshData> solids = {make_box(c - r, c + r)};
      if (radius >= 1e-3f * centre) solids.push_back(make_sphere(c, radius, 16, 32));
      for (const MeshData& solid : solids) {
        const Baked baked = bake(solid, order());
        ASSERT_EQ(baked.openness.size(), solid.positions.size());
        for (const float openness : baked.openness)
          ASSERT_EQ(openness, 1.0f) << "R " << radius << " at " << centre;
      }
    }
}

TEST(AmbientOcclusion, ClosedRoomsAreExactlyShut) {  // A1
  for (const float openness :
       bake(test::reversed(make_box({-1, -1, -1}, {1, 1, 1})), order()).openness)
    EXPECT_EQ(openness, 0.0f);
}

TEST(AmbientOcclusion, SmoothSpheresHaveNoDarkTerminator) {  // G10
  for (const float openness : bake(make_sphere({0, 0, 0}, 1, 8, 16), order()).openness)
    EXPECT_GE(openness, 0.9999f);
}

TEST(AmbientOcclusion, FloorAtAWallsFootSeesHalfTheSky) {  // A2 in the limit
  const MeshData floor = test::make_quad({-1, 0, 1}, {1, 0, 0}, {0, 0, -2});
  const MeshData wall = test::make_quad({0, 0, -400}, {0, 0, 800}, {0, 400, 0});
  const Baked baked = bake(merged(floor, wall), order(0.001));
  // Vertices 1 and 2 of the floor stand at the wall's foot.
  EXPECT_NEAR(baked.openness[1], 0.5, 3e-3);
  EXPECT_NEAR(baked.openness[2], 0.5, 3e-3);
}

TEST(AmbientOcclusion, BytesDoNotDependOnThreadsOrChunks) {
  const MeshData mesh = still_life();
  const Baked one = bake(mesh, order(), 1, 1);
  ASSERT_GT(one.openness.size(), 400u);
  for (const int threads : {2, 8}) EXPECT_EQ(bake(mesh, order(), threads, 1).bytes, one.bytes);
  for (const uint64_t chunks : {2u, 7u, 101u})
    EXPECT_EQ(bake(mesh, order(), 2, chunks).bytes, one.bytes) << chunks;
  const Baked again = bake(mesh, order(), 8, 7);
  ASSERT_EQ(again.assembly.artifacts.size(), one.assembly.artifacts.size());
  for (size_t i = 0; i < one.assembly.artifacts.size(); ++i)
    EXPECT_EQ(again.assembly.artifacts[i].bytes, one.assembly.artifacts[i].bytes)
        << one.assembly.artifacts[i].name;
  // Positive control: another seed is another bake.
  Spec reseeded = order();
  reseeded.seed = 1;
  EXPECT_NE(bake(mesh, reseeded).bytes, one.bytes);
}

TEST(AmbientOcclusion, ScaleChangesNoByte) {  // G4
  Spec spec = order();
  parameters(spec).falloff = Falloff::linear;
  parameters(spec).max_distance = 1.5;
  const Baked plain = bake(still_life(), spec);
  for (const int exponent : {-40, -20, 20, 40}) {
    Spec scaled = spec;
    parameters(scaled).max_distance = std::ldexp(1.5, exponent);
    EXPECT_EQ(bake(test::scaled(still_life(), std::ldexp(1.0f, exponent)), scaled).bytes,
              plain.bytes)
        << exponent;
  }
}

TEST(AmbientOcclusion, FarFromTheOriginDyadicShapesKeepTheirBytes) {  // G5
  MeshData mesh = still_life();
  for (Vec3& p : mesh.positions)
    for (int axis = 0; axis < 3; ++axis) p[axis] = std::round(p[axis] * 64) / 64;
  EXPECT_EQ(bake(test::translated(mesh, {65536, -65536, 65536}), order()).bytes,
            bake(mesh, order()).bytes);
}

TEST(AmbientOcclusion, WindingTurnedRoundChangesNoByte) {  // G9
  MeshData mesh = still_life();
  const Baked plain = bake(mesh, order());
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  EXPECT_EQ(bake(mesh, order()).bytes, plain.bytes);
  // Positive control: turning the normals round looks from the other side.
  EXPECT_NE(bake(test::reversed(still_life()), order()).bytes, plain.bytes);
}

TEST(AmbientOcclusion, MissingNormalsOfFlatMeshesChangeNothing) {  // G9
  const MeshData mesh = merged(test::make_grid(4, 12), make_box({1, 0, -1}, {2, 2, 1}));
  const Baked with = bake(mesh, order());
  const Baked without = bake(test::without_normals(mesh), order());
  for (size_t i = 0; i < with.openness.size(); ++i)
    EXPECT_NEAR(with.openness[i], without.openness[i], 1e-6f);
}

TEST(AmbientOcclusion, DoubledFacesChangeNoByte) {  // G13
  MeshData doubled = still_life();
  const auto once = doubled.triangles;
  doubled.triangles.insert(doubled.triangles.end(), once.begin(), once.end());
  EXPECT_EQ(bake(doubled, order()).bytes, bake(still_life(), order()).bytes);
}

TEST(AmbientOcclusion, VerticesSplitAlongASeamGetOneValue) {
  // Every triangle with corners of its own, as if each were a texture island.
  const MeshData whole = merged(test::make_grid(4, 12), make_sphere({0, 1, 0}, 1, 12, 24));
  MeshData split;
  for (const auto& t : whole.triangles) {
    const auto first = static_cast<uint32_t>(split.positions.size());
    for (const uint32_t corner : t) {
      split.positions.push_back(whole.positions[corner]);
      split.normals.push_back(whole.normals[corner]);
      split.texcoords.push_back({static_cast<float>(first), 0});
    }
    split.triangles.push_back({first, first + 1, first + 2});
  }
  const Baked baked = bake(split, order());
  std::map<uint32_t, std::pair<float, float>> seen;
  size_t corner = 0;
  for (const auto& t : whole.triangles)
    for (const uint32_t vertex : t) {
      const std::pair value{baked.openness[corner], baked.errors[corner]};
      ++corner;
      EXPECT_EQ(seen.emplace(vertex, value).first->second, value);
    }
  EXPECT_EQ(seen.size(), whole.positions.size());
}

TEST(AmbientOcclusion, VerticesOfNoTriangleAreOpenAndCounted) {
  MeshData mesh = still_life();
  mesh.positions.push_back({0, 0.5f, 0});
  mesh.normals.push_back({0, 1, 0});
  mesh.texcoords.push_back({});
  const Baked baked = bake(mesh, order());
  EXPECT_EQ(baked.openness.back(), 1.0f);
  EXPECT_EQ(baked.errors.back(), 0.0f);
  const std::pair<std::string, uint64_t> counted{"vertices_of_no_triangle", 1};
  EXPECT_NE(std::find(baked.plan.repairs.begin(), baked.plan.repairs.end(), counted),
            baked.plan.repairs.end());
}

TEST(AmbientOcclusion, ReachBeyondTheSceneIsNoReachAtAll) {
  const Baked infinite = bake(still_life(), order());
  Spec far = order();
  parameters(far).max_distance = 1e6;
  const Baked limited = bake(still_life(), far);
  EXPECT_EQ(limited.bytes, infinite.bytes);
  EXPECT_FALSE(effect(limited.plan, "max_distance").active);
  Spec near = order();
  parameters(near).max_distance = 0.5;
  const Baked short_rays = bake(still_life(), near);
  EXPECT_TRUE(effect(short_rays.plan, "max_distance").active);
  EXPECT_NE(short_rays.bytes, infinite.bytes);
}

TEST(AmbientOcclusion, WhatIsOffIsNeverTouched) {
  const Baked plain = bake(still_life(), order());
  const RayCounters& counters = plain.assembly.accuracy.counters;
  EXPECT_GT(counters.occlusion_rays, 0u);
  EXPECT_EQ(counters.nearest_rays, 0u);
  EXPECT_EQ(counters.filter_calls, 0u);
  EXPECT_EQ(counters.texture_reads, 0u);
  EXPECT_EQ(counters.rejected_rays, 0u);
  EXPECT_FALSE(effect(plain.plan, "nearest_hit_distance").active);
  EXPECT_FALSE(effect(plain.plan, "alpha_test").active);
  uint64_t rays = 0;
  for (const Round& round : plain.assembly.accuracy.rounds) rays += round.rays;
  EXPECT_EQ(counters.occlusion_rays, rays);

  Spec faded = order();
  parameters(faded).falloff = Falloff::exponential;
  parameters(faded).falloff_distance = 1;
  const Baked nearest = bake(still_life(), faded);
  EXPECT_TRUE(effect(nearest.plan, "nearest_hit_distance").active);
  EXPECT_EQ(nearest.assembly.accuracy.counters.occlusion_rays, 0u);
  EXPECT_GT(nearest.assembly.accuracy.counters.nearest_rays, 0u);
}

// Two parts: a floor and, above it, a square whose left half is cut out by its texture's alpha.
std::vector<std::byte> awning(AlphaMode mode, uint8_t left_alpha) {
  Image8 image{2, 1, 4, {255, 255, 255, left_alpha, 255, 255, 255, 255}};
  test::SceneData scene;
  scene.images.push_back(write_png(image));
  Material material;
  material.alpha_mode = mode;
  material.base_color_texture.texture = 0;
  scene.parts.push_back({test::make_grid(1, 8), {}, {}});
  scene.parts.push_back({test::make_quad({-1, 0.5f, 1}, {2, 0, 0}, {0, 0, -2}), material, {}});
  return make_glb(scene);
}

TEST(AmbientOcclusion, CutOutsLetLightThroughAndFullAlphaCostsNothing) {
  const Baked solid = bake(awning(AlphaMode::opaque, 0), order());
  const Baked full = bake(awning(AlphaMode::mask, 255), order());
  const Baked cut = bake(awning(AlphaMode::mask, 0), order());
  EXPECT_EQ(full.bytes, solid.bytes);
  EXPECT_FALSE(effect(full.plan, "alpha_test").active);
  EXPECT_EQ(full.assembly.accuracy.counters.filter_calls, 0u);
  EXPECT_EQ(full.assembly.accuracy.counters.texture_reads, 0u);
  EXPECT_TRUE(effect(cut.plan, "alpha_test").active);
  EXPECT_TRUE(effect(cut.plan, "textures").active);
  EXPECT_GT(cut.assembly.accuracy.counters.filter_calls, 0u);
  EXPECT_GT(cut.assembly.accuracy.counters.texture_reads, 0u);
  // Row 4 of the grid, left (x = -0.75) and right (x = 0.75).
  EXPECT_GT(cut.openness[4 * 9 + 1], solid.openness[4 * 9 + 1] + 0.2f);
  EXPECT_LT(cut.openness[4 * 9 + 7], solid.openness[4 * 9 + 7] + 0.2f);
}

TEST(AmbientOcclusion, StatusSaysWhetherTheTargetWasReached) {
  const Baked reached = bake(still_life(), order(0.02));
  EXPECT_EQ(reached.assembly.accuracy.status, AccuracyStatus::converged);
  EXPECT_EQ(reached.assembly.accuracy.converged_share, 1);
  EXPECT_LE(reached.assembly.accuracy.error_max, 0.02);
  Spec poor = order(0.001);
  poor.accuracy.max_samples = 64;
  const Baked limited = bake(still_life(), poor);
  EXPECT_EQ(limited.plan.max_samples, 64u);
  EXPECT_EQ(limited.assembly.accuracy.status, AccuracyStatus::budget_limited);
  EXPECT_GT(limited.assembly.accuracy.budget_limited, 0u);
  EXPECT_GT(limited.assembly.accuracy.error_max, 0.001);
}

TEST(AmbientOcclusion, ATimeBudgetPinsTheSampleCount) {
  Spec hurried = order(0.001);
  hurried.accuracy.max_seconds = 1e-9;
  const Baked baked = bake(still_life(), hurried);
  EXPECT_EQ(baked.plan.max_samples, 64u);
  EXPECT_FALSE(baked.plan.warnings.empty());
  hurried.accuracy.max_seconds = 1e9;
  EXPECT_EQ(bake(make_box({0, 0, 0}, {1, 1, 1}), hurried).plan.max_samples, 65536u);
}

TEST(AmbientOcclusion, PricesRiseAsErrorsFall) {
  const Baked baked = bake(still_life(), order());
  ASSERT_EQ(baked.plan.prices.size(), 5u);
  for (size_t i = 1; i < 5; ++i) {
    EXPECT_LT(baked.plan.prices[i].error, baked.plan.prices[i - 1].error);
    EXPECT_GE(baked.plan.prices[i].samples, baked.plan.prices[i - 1].samples);
    EXPECT_GE(baked.plan.prices[i].seconds, baked.plan.prices[i - 1].seconds);
  }
  // What the pilot foretells of samples holds for the bake: every vertex of this scene is in it.
  uint64_t rays = 0;
  for (const Round& round : baked.assembly.accuracy.rounds) rays += round.rays;
  const Baked tenth = bake(still_life(), order(0.01));
  uint64_t tenth_rays = 0;
  for (const Round& round : tenth.assembly.accuracy.rounds) tenth_rays += round.rays;
  const double foretold = static_cast<double>(baked.plan.prices[2].samples * baked.plan.elements);
  EXPECT_NEAR(static_cast<double>(tenth_rays), foretold, 0.3 * foretold);
  EXPECT_GT(tenth_rays, rays);
}

TEST(AmbientOcclusion, CancelledMidwayThrowsAndSaysSo) {
  const std::vector<std::byte> glb = make_glb(still_life());
  Inputs inputs;
  inputs.blobs[kDigest] = glb;
  int updates = 0;
  Progress progress([&](double) { return ++updates < 10; });
  Grants grants;
  grants.threads = 2;
  try {
    bake_all(order(), inputs, grants, progress);
    FAIL() << "not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::cancelled);
  }
  EXPECT_GE(updates, 10);
}

TEST(AmbientOcclusion, ArtifactsHoldTheChunksValues) {
  const Baked baked = bake(still_life(), order());
  const auto& artifacts = baked.assembly.artifacts;
  ASSERT_EQ(artifacts.size(), 3u);
  EXPECT_EQ(artifacts[0].name, "ambient_occlusion.glb");
  const char* names[] = {"ambient_occlusion.exr", "ambient_occlusion_error.exr"};
  for (size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(artifacts[k + 1].name, names[k]);
    const Image image = read_exr(artifacts[k + 1].bytes).image;
    EXPECT_EQ(image.width, baked.document().strip_width);
    EXPECT_EQ(image.height, baked.document().strip_height);
    const std::vector<float>& values = k == 0 ? baked.openness : baked.errors;
    for (size_t i = 0; i < values.size(); ++i)
      ASSERT_EQ(image.pixels[i * static_cast<size_t>(image.channels)], values[i]);
  }
  EXPECT_EQ(baked.document().vertices, baked.openness.size());
  double sum = 0;
  for (const float openness : baked.openness) sum += static_cast<double>(openness);
  EXPECT_NEAR(baked.document().mean, sum / static_cast<double>(baked.openness.size()), 1e-12);
}

TEST(AmbientOcclusion, AnEmptySceneBakesToNothing) {
  const Baked baked = bake(make_glb(test::SceneData{}), order());
  EXPECT_EQ(baked.plan.elements, 0u);
  EXPECT_TRUE(baked.bytes.empty());
  EXPECT_EQ(baked.document().vertices, 0u);
  EXPECT_EQ(baked.assembly.accuracy.status, AccuracyStatus::exact);
}

TEST(AmbientOcclusion, EveryFaultOfAnOrderIsNamedAtOnce) {
  Spec spec = order(2);
  spec.scene.reset();
  parameters(spec).falloff = Falloff::linear;
  parameters(spec).falloff_distance = -1;
  spec.accuracy.max_samples = 1;
  std::vector<std::string> pointers;
  for (const SpecFault& fault : validate(spec)) pointers.push_back(fault.pointer);
  for (const char* pointer :
       {"/inputs/scene", "/parameters/max_distance", "/parameters/falloff_distance",
        "/accuracy/target_error", "/accuracy/max_samples"})
    EXPECT_NE(std::find(pointers.begin(), pointers.end(), pointer), pointers.end()) << pointer;
  EXPECT_TRUE(validate(order()).empty());
}

TEST(AmbientOcclusion, CornellBoxIsDarkInItsCornersAndOpenNowhere) {
  LIGHTKILN_NEEDS_DATA(data);
  std::filesystem::path found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data / "scenes"))
    if (entry.path().filename().string().find("ornell") != std::string::npos &&
        entry.path().extension() == ".glb")
      found = entry.path();
  if (found.empty()) GTEST_SKIP() << "no Cornell box among the scenes";
  const Baked baked = bake(test::read_file(found), order(), 2);
  EXPECT_GT(baked.openness.size(), 20u);
  for (const float openness : baked.openness) {
    EXPECT_GE(openness, 0.0f);
    EXPECT_LE(openness, 1.0f);
  }
}

}  // namespace
}  // namespace lightkiln
