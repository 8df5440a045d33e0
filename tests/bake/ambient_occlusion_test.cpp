// Ambient occlusion through the front door: a GLB goes in, bytes come out.
// Tags beside tests are explained in tests/support/hard_cases.h.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/image/exr.h"
#include "core/image/ldr.h"
#include "tests/support/ao_bake.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::ao_order;
using test::ao_parameters;
using test::bake_ao;
using test::BakedAo;
using test::make_box;
using test::merged;
using test::MeshData;
using test::still_life;

const Effect& effect(const Plan& plan, const std::string& name) {
  for (const Effect& e : plan.effects)
    if (e.name == name) return e;
  throw std::runtime_error("no effect " + name);
}

TEST(AmbientOcclusion, FloorAtAWallsFootSeesHalfTheSky) {  // A2 in the limit
  const MeshData floor = test::make_quad({-1, 0, 1}, {1, 0, 0}, {0, 0, -2});
  const MeshData wall = test::make_quad({0, 0, -400}, {0, 0, 800}, {0, 400, 0});
  const BakedAo baked = bake_ao(merged(floor, wall), ao_order(0.001));
  // Vertices 1 and 2 of the floor stand at the wall's foot.
  EXPECT_NEAR(baked.openness[1], 0.5, 3e-3);
  EXPECT_NEAR(baked.openness[2], 0.5, 3e-3);
}

TEST(AmbientOcclusion, VerticesOfNoTriangleAreOpenAndCounted) {
  MeshData mesh = still_life();
  mesh.positions.push_back({0, 0.5f, 0});
  mesh.normals.push_back({0, 1, 0});
  mesh.texcoords.push_back({});
  const BakedAo baked = bake_ao(mesh, ao_order());
  EXPECT_EQ(baked.openness.back(), 1.0f);
  EXPECT_EQ(baked.errors.back(), 0.0f);
  const std::pair<std::string, uint64_t> counted{"vertices_of_no_triangle", 1};
  EXPECT_NE(std::find(baked.plan.repairs.begin(), baked.plan.repairs.end(), counted),
            baked.plan.repairs.end());
}

TEST(AmbientOcclusion, ReachBeyondTheSceneIsNoReachAtAll) {
  const BakedAo infinite = bake_ao(still_life(), ao_order());
  Spec far = ao_order();
  ao_parameters(far).max_distance = 1e6;
  const BakedAo limited = bake_ao(still_life(), far);
  EXPECT_EQ(limited.bytes, infinite.bytes);
  EXPECT_FALSE(effect(limited.plan, "max_distance").active);
  Spec near = ao_order();
  ao_parameters(near).max_distance = 0.5;
  const BakedAo short_rays = bake_ao(still_life(), near);
  EXPECT_TRUE(effect(short_rays.plan, "max_distance").active);
  EXPECT_NE(short_rays.bytes, infinite.bytes);
}

TEST(AmbientOcclusion, WhatIsOffIsNeverTouched) {
  const BakedAo plain = bake_ao(still_life(), ao_order());
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

  Spec faded = ao_order();
  ao_parameters(faded).falloff = Falloff::exponential;
  ao_parameters(faded).falloff_distance = 1;
  const BakedAo nearest = bake_ao(still_life(), faded);
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
  return test::make_glb(scene);
}

TEST(AmbientOcclusion, CutOutsLetLightThroughAndFullAlphaCostsNothing) {
  const BakedAo solid = bake_ao(awning(AlphaMode::opaque, 0), ao_order());
  const BakedAo full = bake_ao(awning(AlphaMode::mask, 255), ao_order());
  const BakedAo cut = bake_ao(awning(AlphaMode::mask, 0), ao_order());
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
  const BakedAo reached = bake_ao(still_life(), ao_order(0.02));
  EXPECT_EQ(reached.assembly.accuracy.status, AccuracyStatus::converged);
  EXPECT_EQ(reached.assembly.accuracy.converged_share, 1);
  EXPECT_LE(reached.assembly.accuracy.error_max, 0.02);
  Spec poor = ao_order(0.001);
  poor.accuracy.max_samples = 64;
  const BakedAo limited = bake_ao(still_life(), poor);
  EXPECT_EQ(limited.plan.max_samples, 64u);
  EXPECT_EQ(limited.assembly.accuracy.status, AccuracyStatus::budget_limited);
  EXPECT_GT(limited.assembly.accuracy.budget_limited, 0u);
  EXPECT_GT(limited.assembly.accuracy.error_max, 0.001);
}

TEST(AmbientOcclusion, TheDocumentSaysWhichMeshesFellShort) {
  // A floor under a sphere, and a plate that nothing reaches.
  test::SceneData scene;
  scene.parts.push_back({merged(test::make_grid(4, 12), test::make_sphere({0, 1, 0}, 1)), {}, {}});
  scene.parts.push_back({test::make_floor(4, 50), {}, {}});
  Spec poor = ao_order(0.001);
  poor.accuracy.max_samples = 64;
  ao_parameters(poor).max_distance = 3;
  const BakedAo baked = bake_ao(test::make_glb(scene), poor);
  const AoDocument& document = baked.document();
  ASSERT_EQ(document.meshes.size(), 2u);
  EXPECT_GT(document.meshes[0].budget_limited, 0u);
  EXPECT_EQ(document.meshes[1].budget_limited, 0u);
  EXPECT_EQ(document.meshes[1].suspicious, 0u);
  EXPECT_EQ(document.budget_limited, baked.assembly.accuracy.budget_limited);
  EXPECT_EQ(document.suspicious, baked.assembly.accuracy.suspicious);
  const BakedAo reached = bake_ao(test::make_glb(scene), ao_order(0.05));
  EXPECT_EQ(reached.document().budget_limited, 0u);
}

TEST(AmbientOcclusion, ATimeBudgetPinsTheSampleCount) {
  Spec hurried = ao_order(0.001);
  hurried.accuracy.max_seconds = 1e-9;
  const BakedAo baked = bake_ao(still_life(), hurried);
  EXPECT_EQ(baked.plan.max_samples, 64u);
  EXPECT_FALSE(baked.plan.warnings.empty());
  hurried.accuracy.max_seconds = 1e9;
  EXPECT_EQ(bake_ao(make_box({0, 0, 0}, {1, 1, 1}), hurried).plan.max_samples, 65536u);
}

TEST(AmbientOcclusion, PricesRiseAsErrorsFall) {
  const BakedAo baked = bake_ao(still_life(), ao_order());
  ASSERT_EQ(baked.plan.prices.size(), 5u);
  for (size_t i = 1; i < 5; ++i) {
    EXPECT_LT(baked.plan.prices[i].error, baked.plan.prices[i - 1].error);
    EXPECT_GE(baked.plan.prices[i].samples, baked.plan.prices[i - 1].samples);
    EXPECT_GE(baked.plan.prices[i].seconds, baked.plan.prices[i - 1].seconds);
  }
  // What the pilot foretells of samples holds for the bake: every vertex of this scene is in it.
  uint64_t rays = 0;
  for (const Round& round : baked.assembly.accuracy.rounds) rays += round.rays;
  const BakedAo tenth = bake_ao(still_life(), ao_order(0.01));
  uint64_t tenth_rays = 0;
  for (const Round& round : tenth.assembly.accuracy.rounds) tenth_rays += round.rays;
  const double foretold = static_cast<double>(baked.plan.prices[2].samples * baked.plan.elements);
  EXPECT_NEAR(static_cast<double>(tenth_rays), foretold, 0.3 * foretold);
  EXPECT_GT(tenth_rays, rays);
}

TEST(AmbientOcclusion, PricesThatAnyVertexTakesPastThePilotAreExtrapolated) {
  // Most of a wide floor is open at once, so the mean is low while a few vertices need many rounds.
  const MeshData mesh = merged(test::make_grid(60, 32), test::make_sphere({0, 1, 0}, 1, 6, 12));
  Spec spec = ao_order(0.003);
  ao_parameters(spec).max_distance = 3;
  const BakedAo baked = bake_ao(mesh, spec);
  uint64_t most = 0;
  for (const Round& round : baked.assembly.accuracy.rounds) most = std::max(most, round.samples);
  ASSERT_GT(most, 2048u);
  EXPECT_LT(baked.plan.prices[3].samples, 2048u);
  EXPECT_TRUE(baked.plan.prices[3].extrapolated);
  EXPECT_FALSE(baked.plan.prices[0].extrapolated);
}

TEST(AmbientOcclusion, TheBoundOfAFalloffIsItsLargestWeight) {
  Spec faded = ao_order();
  ao_parameters(faded).falloff = Falloff::exponential;
  ao_parameters(faded).falloff_distance = 100;
  const BakedAo with = bake_ao(still_life(), faded);
  const BakedAo without = bake_ao(still_life(), ao_order());
  const double diagonal = std::sqrt(8.0 * 8 + 2 * 2 + 8 * 8);
  const double bound = effect(with.plan, "falloff").bound;
  EXPECT_NEAR(bound, 1 - std::exp(-diagonal / 100), 1e-4);
  double change = 0;
  for (size_t i = 0; i < with.openness.size(); ++i)
    change = std::max(change, static_cast<double>(with.openness[i] - without.openness[i]));
  EXPECT_LE(change, bound + 0.04);  // two error bars
  EXPECT_GT(change, 0);
  EXPECT_EQ(effect(without.plan, "falloff").bound, 0);
}

TEST(AmbientOcclusion, CancelledMidwayThrowsAndSaysSo) {
  const std::vector<std::byte> glb = test::make_glb(still_life());
  Inputs inputs;
  inputs.blobs[test::ao_digest()] = glb;
  int updates = 0;
  Progress progress([&](double) { return ++updates < 10; });
  Grants grants;
  grants.threads = 2;
  try {
    bake_all(ao_order(), inputs, grants, progress);
    FAIL() << "not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::cancelled);
  }
  EXPECT_GE(updates, 10);
}

TEST(AmbientOcclusion, ArtifactsHoldTheChunksValues) {
  const BakedAo baked = bake_ao(still_life(), ao_order());
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
  const BakedAo baked = bake_ao(test::make_glb(test::SceneData{}), ao_order());
  EXPECT_EQ(baked.plan.elements, 0u);
  EXPECT_TRUE(baked.bytes.empty());
  EXPECT_EQ(baked.document().vertices, 0u);
  EXPECT_EQ(baked.assembly.accuracy.status, AccuracyStatus::exact);
}

TEST(AmbientOcclusion, EveryFaultOfAnOrderIsNamedAtOnce) {
  Spec spec = ao_order(2);
  spec.scene.reset();
  ao_parameters(spec).falloff = Falloff::linear;
  ao_parameters(spec).falloff_distance = -1;
  spec.accuracy.max_samples = 1;
  std::vector<std::string> pointers;
  for (const SpecFault& fault : validate(spec)) pointers.push_back(fault.pointer);
  for (const char* pointer :
       {"/inputs/scene", "/parameters/max_distance", "/parameters/falloff_distance",
        "/accuracy/target_error", "/accuracy/max_samples"})
    EXPECT_NE(std::find(pointers.begin(), pointers.end(), pointer), pointers.end()) << pointer;
  EXPECT_TRUE(validate(ao_order()).empty());
}

TEST(AmbientOcclusion, TheRoomOfTheCornellBoxIsDarkInItsCornersAndOpenNowhere) {
  LIGHTKILN_NEEDS_DATA(data);
  const BakedAo baked =
      bake_ao(test::read_file(data / "scenes" / "cornell_box" / "CornellBox.glb"), ao_order(), 2);
  // Three primitives of the room, open at one side only; every vertex lies in a corner or an edge.
  int rooms = 0;
  for (const AoMeshIndex& mesh : baked.document().meshes) {
    const std::string& name = mesh.name;
    if (name.starts_with("cornell.box")) {
      ++rooms;
      EXPECT_LT(mesh.min, 0.05) << name;
      EXPECT_LT(mesh.max, 0.45) << name;
      EXPECT_NEAR(mesh.mean, 0.19, 0.04) << name;
    } else if (name.starts_with("Light")) {
      EXPECT_NEAR(mesh.mean, 0.19, 0.04);
      EXPECT_LT(mesh.max, 0.3);
    } else {
      EXPECT_LT(mesh.mean, 0.5) << name;  // undersides look out below the floor
    }
  }
  EXPECT_EQ(rooms, 3);
}

}  // namespace
}  // namespace lightkiln
