#include "core/trace/effects.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

const EffectReason& effect(const LitScene& lit, const std::string& name) {
  const auto& reasons = lit.effects.reasons;
  const auto found = std::find_if(reasons.begin(), reasons.end(),
                                  [&](const EffectReason& e) { return e.name == name; });
  if (found == reasons.end()) throw std::runtime_error("no effect " + name);
  return *found;
}

Environment two_tone_sky() {
  Environment sky = constant_environment({1, 1, 1});
  sky.constant = false;
  sky.radiance = Image(2, 1, 3);
  sky.radiance.pixels = {2, 2, 2, 0.5f, 0.5f, 0.5f};
  sky.mean = {1.25, 1.25, 1.25};
  sky.max_luminance = 2;
  return sky;
}

Texture flat_texture(uint8_t level, uint8_t alpha = 255) {
  Texture texture;
  texture.width = texture.height = 1;
  texture.rgba = {level, level, level, alpha};
  return texture;
}

PunctualLight lamp(LightKind kind, float intensity) {
  PunctualLight light;
  light.kind = kind;
  light.intensity = {intensity, intensity, intensity};
  light.position = {0.3, 1.5, 0.2};
  light.direction = {0, -1, 0};
  return light;
}

// Floor and block, plain.
SceneData plain_scene() {
  SceneData data;
  data.parts.push_back({make_floor(2), grey(0.5f), {}});
  data.parts.push_back({make_box({-1, 0.1f, -1}, {-0.5f, 1, -0.4f}), grey(0.4f), {}});
  return data;
}

SceneData scene_with_everything() {
  SceneData data = plain_scene();
  data.parts[0].material.base_color_texture.texture = 0;
  data.parts[1].mesh.colors.assign(data.parts[1].mesh.positions.size(), {1, 0.5f, 0.2f, 1});
  data.parts.push_back(
      {make_quad({-0.2f, 1, -0.2f}, {0.4f, 0, 0}, {0, 0, 0.4f}), grey(0.2f, 5), {}});
  Material masked = grey(0.6f);
  masked.alpha_mode = AlphaMode::mask;
  masked.base_color_texture.texture = 1;
  data.parts.push_back({make_quad({0.5f, 0.5f, -0.5f}, {0.5f, 0, 0}, {0, 0, 0.5f}), masked, {}});
  data.textures = {flat_texture(200), flat_texture(255)};
  data.textures[1].width = 2;
  data.textures[1].rgba = {255, 255, 255, 255, 255, 255, 255, 0};
  data.lights = {lamp(LightKind::point, 3), lamp(LightKind::spot, 3),
                 lamp(LightKind::directional, 1)};
  return data;
}

// What 1024 rays in all directions bring, and what they cost.
struct Result {
  std::vector<Vec3> radiance;
  RayCounters counters;
};
Result results(const LitScene& lit) {
  Result result;
  for (uint32_t i = 0; i < 1024; ++i) {
    const float z = 1 - 2 * (static_cast<float>(i) + 0.5f) / 1024, r = std::sqrt(1 - z * z);
    const float phi = 2.399963f * static_cast<float>(i);
    const Ray ray = lit.ray({0, 0.8f, 0.9f}, {r * std::cos(phi), z, r * std::sin(phi)});
    result.radiance.push_back(lit.radiance->sample(ray, 5, i, result.counters));
  }
  return result;
}
bool same_bytes(const Result& a, const Result& b) {
  return std::memcmp(a.radiance.data(), b.radiance.data(), a.radiance.size() * sizeof(Vec3)) == 0;
}
bool same_counters(const RayCounters& a, const RayCounters& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

// 1. Changes nothing: the kernel for the mask gives the bytes of the kernel with every bit on.
TEST(Effects, SpecialisedKernelsGiveTheGenericKernelsBytes) {
  std::vector<SceneData> scenes = {plain_scene(), scene_with_everything()};
  for (const std::string left_out : {"emission", "lights", "textures", "colors"}) {
    SceneData data = scene_with_everything();
    if (left_out == "emission") data.parts[2].material.emissive = {0, 0, 0};
    if (left_out == "lights") data.lights.clear();
    if (left_out == "textures") {
      for (Part& part : data.parts) part.material.base_color_texture.texture = -1;
    }
    if (left_out == "colors") data.parts[1].mesh.colors.clear();
    scenes.push_back(data);
  }
  for (const SceneData& data : scenes) {
    for (int sky = 0; sky < 3; ++sky) {
      std::optional<Environment> environment;
      if (sky == 1) environment = constant_environment({1, 1, 1});
      if (sky == 2) environment = two_tone_sky();
      LitScene lit(data, environment, bounces(3));
      const Result special = results(lit);
      lit.prepare(bounces(3), nullptr, kAllRadianceBits);
      const Result generic = results(lit);
      EXPECT_TRUE(same_bytes(special, generic));
      EXPECT_TRUE(same_counters(special.counters, generic.counters));
    }
  }
}

// 2. Off is the same as null: assets without effect leave bytes and counters as without them.
TEST(Effects, NullAssetsEqualAbsentOnes) {
  const LitScene bare(plain_scene(), two_tone_sky(), bounces(3));
  const Result expected = results(bare);
  const auto expect_same = [&](const SceneData& data, const char* what) {
    const LitScene lit(data, two_tone_sky(), bounces(3));
    EXPECT_EQ(lit.effects.selection, bare.effects.selection) << what;
    const Result result = results(lit);
    EXPECT_TRUE(same_bytes(result, expected)) << what;
    EXPECT_TRUE(same_counters(result.counters, expected.counters)) << what;
  };
  SceneData data = plain_scene();
  data.textures.push_back(flat_texture(255));
  data.parts[0].material.base_color_texture.texture = 0;
  expect_same(data, "white texture");

  data = plain_scene();
  data.textures.push_back(flat_texture(40));
  expect_same(data, "unused texture");

  data = plain_scene();
  data.textures.push_back(flat_texture(0));
  data.parts[0].material.emissive = {3, 3, 3};
  data.parts[0].material.emissive_texture.texture = 0;
  expect_same(data, "black emission");

  data = plain_scene();
  data.lights.push_back(lamp(LightKind::point, 0));
  expect_same(data, "dark light");

  data = plain_scene();
  data.parts[0].mesh.colors.assign(4, {1, 1, 1, 1});
  expect_same(data, "white vertex colours");

  data = plain_scene();
  data.textures.push_back(flat_texture(255));
  data.parts[0].material.alpha_mode = AlphaMode::mask;
  data.parts[0].material.base_color_texture.texture = 0;
  expect_same(data, "mask without holes");
}

// The control of the test above: assets with an effect do change the bytes.
TEST(Effects, AssetsWithAnEffectChangeTheResult) {
  const Result plain = results(LitScene(plain_scene(), two_tone_sky(), bounces(3)));
  SceneData data = plain_scene();
  data.textures.push_back(flat_texture(254));
  data.parts[0].material.base_color_texture.texture = 0;
  EXPECT_FALSE(same_bytes(results(LitScene(data, two_tone_sky(), bounces(3))), plain));
  data = plain_scene();
  data.lights.push_back(lamp(LightKind::point, 0.01f));
  EXPECT_FALSE(same_bytes(results(LitScene(data, two_tone_sky(), bounces(3))), plain));
}

// 3. Costs nothing: what is off leaves its counters at zero.
TEST(Effects, CountersOfWhatIsOffAreZero) {
  const RayCounters dark = results(LitScene(plain_scene(), {}, bounces(0))).counters;
  EXPECT_EQ(dark.nearest_rays, 1024u);
  EXPECT_EQ(dark.bounce_rays, 0u);
  EXPECT_EQ(dark.shadow_rays, 0u);
  EXPECT_EQ(dark.texture_reads, 0u);
  EXPECT_EQ(dark.filter_calls, 0u);
  EXPECT_EQ(dark.environment_reads, 0u);

  const RayCounters even =
      results(LitScene(plain_scene(), constant_environment({1, 1, 1}), bounces(3))).counters;
  EXPECT_GT(even.bounce_rays, 0u);
  EXPECT_GT(even.environment_reads, 0u);
  EXPECT_EQ(even.shadow_rays, 0u);

  const RayCounters all =
      results(LitScene(scene_with_everything(), two_tone_sky(), bounces(3))).counters;
  EXPECT_GT(all.shadow_rays, 0u);
  EXPECT_GT(all.texture_reads, 0u);
  EXPECT_GT(all.filter_calls, 0u);
}

// An effect switched on or off leaves the random points of all others alone.
TEST(Effects, LightsAddUpSampleBySample) {
  const auto with = [&](bool emission, bool lights, bool sky) {
    SceneData data = scene_with_everything();
    if (!emission) data.parts[2].material.emissive = {0, 0, 0};
    if (!lights) data.lights.clear();
    return results(LitScene(data, sky ? std::optional(two_tone_sky()) : std::nullopt, bounces(3)));
  };
  const Result emission = with(true, false, false), lights = with(false, true, false);
  const Result sky = with(false, false, true), all = with(true, true, true);
  for (size_t i = 0; i < all.radiance.size(); ++i) {
    const float sum = emission.radiance[i].x + lights.radiance[i].x + sky.radiance[i].x;
    EXPECT_NEAR(all.radiance[i].x, sum, 1e-5f * std::max(1.0f, sum));
  }
}

// 4. Explains itself.
TEST(Effects, EveryEffectIsListedWithReasonAndBound) {
  const LitScene lit(scene_with_everything(), two_tone_sky(), {std::nullopt, 0.05, 0.7});
  std::vector<std::string> names;
  for (const EffectReason& e : lit.effects.reasons) {
    names.push_back(e.name);
    EXPECT_EQ(e.reason.empty() ? ' ' : e.reason.back(), '.') << e.name;
    EXPECT_TRUE(std::isfinite(e.bound) && e.bound >= 0) << e.name;
  }
  const std::vector<std::string> expected = {"environment",
                                             "environment_variation",
                                             "emissive_surfaces",
                                             "emissive_sampling",
                                             "punctual_directional",
                                             "punctual_point",
                                             "punctual_spot",
                                             "punctual_patches",
                                             "textures",
                                             "vertex_colors",
                                             "alpha_test",
                                             "unlit",
                                             "diffuse_bounces",
                                             "specular_reflection",
                                             "transmission",
                                             "nearest_distance"};
  EXPECT_EQ(names, expected);
  EXPECT_FALSE(effect(lit, "specular_reflection").active);
  EXPECT_FALSE(effect(lit, "unlit").active);
  for (const char* on :
       {"environment", "environment_variation", "emissive_surfaces", "emissive_sampling",
        "punctual_point", "textures", "vertex_colors", "alpha_test", "diffuse_bounces"}) {
    EXPECT_TRUE(effect(lit, on).active) << on;
  }
}

TEST(Effects, FewestBouncesWhoseBoundIsUnderATenthOfTheOrder) {
  const LitScene lit(plain_scene(), constant_environment({1, 1, 1}), bounces(1));
  for (const double target : {0.3, 0.1, 0.01, 0.001}) {
    const EffectPlan plan = decide_effects(lit.survey, {std::nullopt, target, 0.8});
    const int k = plan.selection.max_bounces;
    // R rho^(k+1) / (1 - rho) / reference with rho = 0.5, R = 1.
    EXPECT_LE(std::pow(0.5, k + 1) / 0.5 / 0.8, kTruncationShare * target);
    EXPECT_GT(std::pow(0.5, k) / 0.5 / 0.8, kTruncationShare * target);
  }
}

// What is left out on purpose is summed up, and stays under its share of the order.
TEST(Effects, WhatIsLeftOutIsToldAsBias) {
  SceneData data = plain_scene();
  data.lights.push_back(lamp(LightKind::point, 1e-5f));
  const LitScene lit(data, constant_environment({1, 1, 1}), {std::nullopt, 0.1, 1.0});
  const double lamp_bound = effect(lit, "punctual_point").bound;
  EXPECT_GT(lamp_bound, 0);
  EXPECT_GT(lit.effects.truncation_bound, 0);
  EXPECT_EQ(lit.effects.bias_bound, lamp_bound + lit.effects.truncation_bound);
  EXPECT_LE(lit.effects.bias_bound, kBiasShare * 0.1);
  // Bounces that were ordered leave nothing out that was asked for.
  const LitScene ordered(data, constant_environment({1, 1, 1}), {2, 0.1, 1.0});
  EXPECT_GT(ordered.effects.truncation_bound, 0);
  EXPECT_EQ(ordered.effects.bias_bound, effect(ordered, "punctual_point").bound);
  // Nothing negligible, nothing truncated: no bias.
  const LitScene all(plain_scene(), constant_environment({1, 1, 1}), {3, 0.1, 1.0});
  EXPECT_EQ(all.effects.bias_bound, 0);
}

TEST(Effects, WhiteRoomsEndAtSixtyFourBouncesAndSaySo) {
  SceneData data;
  data.parts.push_back({make_floor(1), grey(1), {}});
  const LitScene lit(data, constant_environment({1, 1, 1}), {std::nullopt, 0.05, 1.0});
  EXPECT_EQ(lit.effects.selection.max_bounces, kMostBounces);
  EXPECT_EQ(lit.effects.truncation_bound, kBoundCeiling);
  ASSERT_EQ(lit.effects.warnings.size(), 1u);
}

TEST(Effects, LightTooFaintForTheOrderIsLeftOut) {
  SceneData data = plain_scene();
  data.lights.push_back(lamp(LightKind::point, 1e-5f));
  const LitScene coarse(data, constant_environment({1, 1, 1}), {std::nullopt, 0.1, 1.0});
  EXPECT_FALSE(effect(coarse, "punctual_point").active);
  EXPECT_GT(effect(coarse, "punctual_point").bound, 0);
  EXPECT_LT(effect(coarse, "punctual_point").bound, kNegligibleShare * 0.1);
  const LitScene fine(data, constant_environment({1, 1, 1}), {std::nullopt, 1e-5, 1.0});
  EXPECT_TRUE(effect(fine, "punctual_point").active);
}

TEST(Effects, MetalsAndBlendingAreWarnedAbout) {
  SceneData data = plain_scene();
  data.parts[0].material.metallic = 1;
  data.parts[1].material.alpha_mode = AlphaMode::blend;
  const LitScene lit(data, constant_environment({1, 1, 1}), {std::nullopt, 0.05, 1.0});
  ASSERT_EQ(lit.effects.warnings.size(), 2u);
  EXPECT_NE(lit.effects.warnings[0].find("metallic"), std::string::npos);
  EXPECT_NE(lit.effects.warnings[1].find("BLEND"), std::string::npos);
  EXPECT_GT(effect(lit, "specular_reflection").bound, 0);
}

TEST(Effects, SelectionFollowsFromTheListOfEffects) {
  const EffectOrder order{std::nullopt, 0.05, 0.7};
  const LitScene lit(scene_with_everything(), two_tone_sky(), order);
  EXPECT_EQ(selection_of(lit.effects.reasons, lit.effects.selection.max_bounces, lit.survey, order),
            lit.effects.selection);
}

}  // namespace
}  // namespace lightkiln::test
