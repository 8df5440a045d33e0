// Ways to find small lights change noise, never what is expected.

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/trace/texture.h"
#include "core/trace/textured_emission.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

Texture speckled(int width, int height, WrapMode wrap, bool nearest) {
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.wrap_s = texture.wrap_t = wrap;
  texture.nearest = nearest;
  for (int i = 0; i < width * height; ++i) {
    const auto value = static_cast<uint8_t>(hash64(static_cast<uint64_t>(i)) % 4 == 0 ? 200 : 0);
    texture.rgba.insert(texture.rgba.end(), {value, value, value, 255});
  }
  return texture;
}

// Draws of a triangle give, weighted by their densities, the mean that even points give; and the
// density told of a point is that of its draw.
TEST(TexturedEmission, DrawsWeighWhatEvenPointsShow) {
  const SurfaceMesh mesh =
      make_scene({{{make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), {}, {}}}, {}, {}, {}}).meshes.at(0);
  for (const WrapMode wrap : {WrapMode::repeat, WrapMode::mirrored_repeat, WrapMode::clamp}) {
    for (const bool nearest : {true, false}) {
      const Texture texture = speckled(7, 5, wrap, nearest);
      TextureSlot slot;
      slot.texture = 0;
      slot.offset = {-0.4f, 0.3f};
      slot.scale = {2.3f, -1.7f};
      slot.rotation_rad = 0.6f;
      const TexturedEmission emission(mesh, slot, texture, {2, 2, 2}, 0);
      constexpr uint32_t kDraws = 1 << 15;
      for (uint32_t t = 0; t < 2; ++t) {
        const auto shines = [&](float u, float v) {
          const Vec2 uv = transform_texcoord(slot, interpolate_texcoord(mesh, 0, t, u, v));
          return 2 * static_cast<double>(sample_texture(texture, uv).x);
        };
        double drawn = 0, even = 0, apart = 0;
        for (uint32_t i = 0; i < kDraws; ++i) {
          const Point4 p = sobol4(3, i);
          const TexturedEmission::Point point = emission.sample(t, p.x, p.y, p.z);
          if (!(emission.mean(t) > 0)) break;
          drawn += shines(point.u, point.v) / point.density / kDraws;
          apart += std::abs(emission.density(t, point.u, point.v) / point.density - 1) > 1e-4;
          const float s = std::sqrt(p.y);
          even += shines(s * (1 - p.z), s * p.z) / kDraws;
        }
        if (even < 0.01) continue;  // the rim that clamping repeats is dark there
        EXPECT_NEAR(drawn / even, 1, 0.005);
        EXPECT_NEAR(emission.mean(t) / even, 1, 0.15);  // cells that a triangle cuts count in part
        EXPECT_LE(apart, 1e-3 * kDraws);                // points on a cell's border, to a float
      }
    }
  }
}

TEST(TexturedEmission, OneTexelOfAMillionIsFound) {
  Texture texture;
  texture.width = texture.height = 1024;
  texture.rgba.assign(4 << 20, 0);
  std::fill_n(&texture.rgba[4 * (300 * 1024 + 700)], 4, uint8_t{255});
  const SurfaceMesh mesh =
      make_scene({{{make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), {}, {}}}, {}, {}, {}}).meshes.at(0);
  TextureSlot slot;
  slot.texture = 0;
  const TexturedEmission emission(mesh, slot, texture, {1, 1, 1}, 0);
  EXPECT_NEAR(emission.mean(0) + emission.mean(1), 2 * 0x1p-20, 1e-9);
  const uint32_t bright = emission.mean(0) > emission.mean(1) ? 0 : 1;
  double found = 0;
  for (uint32_t i = 0; i < 1024; ++i) {
    const Point4 p = sobol4(3, i);
    const TexturedEmission::Point point = emission.sample(bright, p.x, p.y, p.z);
    const Vec2 uv = interpolate_texcoord(mesh, 0, bright, point.u, point.v);
    found += sample_texture(texture, uv).x > 0;
  }
  // The hot texel's cell, 36 of 64 draws, and of its neighbours' the halves that read it: 49 of 64.
  EXPECT_NEAR(found / 1024, 49.0 / 64, 0.02);
  EXPECT_EQ(emission.density(1 - bright, 0.3f, 0.3f), 0);
}

// Coordinates that span no area, or reach too far, are drawn evenly instead of not at all.
TEST(TexturedEmission, HopelessCoordinatesAreDrawnEvenly) {
  SurfaceMesh mesh =
      make_scene({{{make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), {}, {}}}, {}, {}, {}}).meshes.at(0);
  const Texture texture = speckled(8, 8, WrapMode::repeat, false);
  TextureSlot slot;
  slot.texture = 0;
  for (const float scale : {0.0f, 1e7f, INFINITY}) {
    slot.scale = {scale, scale};
    const TexturedEmission emission(mesh, slot, texture, {1, 1, 1}, 0);
    EXPECT_GT(emission.mean(0), 0) << scale;
    EXPECT_EQ(emission.density(0, 0.2f, 0.3f), 1) << scale;
    EXPECT_EQ(emission.sample(0, 0.5f, 0.2f, 0.3f).density, 1) << scale;
  }
}

PunctualLight spot(double x, double outer_rad) {
  PunctualLight light;
  light.kind = LightKind::spot;
  light.intensity = {10, 10, 10};
  light.position = {x, 0.8, 0.1};
  light.direction = {0, -1, 0};
  light.inner_cone_rad = 0.5 * outer_rad;
  light.outer_cone_rad = outer_rad;
  return light;
}

SceneData lit_room(int lights, double outer_rad) {
  SceneData data;
  data.parts.push_back({reversed(make_box({-1, -1, -1}, {1, 1, 1})), grey(0.6f), {}});
  data.parts.push_back({make_box({-0.3f, -1, -0.3f}, {0.1f, -0.4f, 0.3f}), grey(0.4f), {}});
  for (int i = 0; i < lights; ++i) data.lights.push_back(spot(-0.6 + 0.1 * i, outer_rad));
  return data;
}

// For few lights, and for more than each get a ray.
TEST(Patches, ConnectionsLeaveTheMeanAlone) {
  for (const int lights : {1, 12}) {
    LitScene lit(lit_room(lights, 0.15), {}, bounces(3));
    ASSERT_TRUE(lit.effects.selection.punctual_patches);
    const Ray ray = lit.ray({0.2f, 0.1f, 0.3f}, {1, 0.3f, 0.2f});
    const Estimate with = estimate(lit, ray, 4096);
    lit.prepare(bounces(3), [](EffectSelection& s) { s.punctual_patches = false; });
    const Estimate without = estimate(lit, ray, 16384);
    EXPECT_NEAR(luminance(with.mean) / luminance(without.mean), 1,
                1.5 * std::hypot(with.half_width, without.half_width) / luminance(without.mean))
        << lights;
    EXPECT_LT(with.half_width, without.half_width) << lights;
    EXPECT_LT(without.half_width, 0.1 * luminance(without.mean)) << lights;
  }
}

TEST(Patches, AreFollowedOnlyWhereTheyAreSmall) {
  const LitScene narrow(lit_room(1, 0.15), {}, bounces(2));
  EXPECT_TRUE(narrow.effects.selection.punctual_patches);
  const LitScene wide(lit_room(1, 0.8), {}, bounces(2));
  EXPECT_FALSE(wide.effects.selection.punctual_patches);
  EXPECT_FALSE(wide.radiance->has(Sight::patches));
  SceneData data = lit_room(1, 0.8);
  data.lights[0].kind = LightKind::point;
  EXPECT_FALSE(LitScene(data, {}, bounces(2)).effects.selection.punctual_patches);
  data.lights[0].position.y = 0.99;  // a centimetre under the ceiling
  EXPECT_TRUE(LitScene(data, {}, bounces(2)).effects.selection.punctual_patches);
}

}  // namespace
}  // namespace lightkiln::test
