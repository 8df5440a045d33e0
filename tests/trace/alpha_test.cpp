#include <cmath>

#include <gtest/gtest.h>

#include "core/trace/texture.h"
#include "core/trace/tracer.h"
#include "tests/trace/raw_scene.h"

namespace lightkiln {
namespace {

// Left half transparent, right half opaque, 2 x 1 texels.
Texture half_transparent(bool nearest) {
  Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.rgba = {255, 255, 255, 0, 255, 255, 255, 255};
  texture.nearest = nearest;
  texture.wrap_s = WrapMode::clamp;
  texture.wrap_t = WrapMode::clamp;
  return texture;
}

// The unit square in the plane z = 0 with u = x, v = y.
Scene masked_square(AlphaMode mode) {
  Material material;
  material.alpha_mode = mode;
  material.base_color_texture.texture = 0;
  Scene scene = test::raw_scene(test::make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), material);
  scene.textures.push_back(half_transparent(true));
  return scene;
}

Ray down_at(float x) {
  return {{x, 0.3f, 1}, {0, 0, -1}};
}

TEST(AlphaTest, HitsBelowTheCutoffLetRaysPass) {
  const Scene scene = masked_square(AlphaMode::mask);
  ASSERT_TRUE(needs_alpha_test(scene, scene.meshes[0]));
  const Tracer tracer(scene, {});
  RayCounters counters;
  EXPECT_FALSE(tracer.occluded(down_at(0.25f), counters));
  EXPECT_FALSE(tracer.nearest(down_at(0.25f), counters).hit());
  EXPECT_TRUE(tracer.occluded(down_at(0.75f), counters));
  EXPECT_NEAR(tracer.nearest(down_at(0.75f), counters).t, 1, 1e-6);
  EXPECT_EQ(counters.filter_calls, 4u);
  EXPECT_EQ(counters.texture_reads, 4u);
}

TEST(AlphaTest, CostsNothingWhereNoTexelCanFail) {
  Scene opaque = masked_square(AlphaMode::opaque);
  Scene full = masked_square(AlphaMode::mask);
  full.textures[0].rgba[3] = 255;
  for (const Scene* scene : {&opaque, &full}) {
    EXPECT_FALSE(needs_alpha_test(*scene, scene->meshes[0]));
    const Tracer tracer(*scene, {});
    RayCounters counters;
    EXPECT_TRUE(tracer.occluded(down_at(0.25f), counters));
    EXPECT_EQ(counters.filter_calls, 0u);
    EXPECT_EQ(counters.texture_reads, 0u);
  }
  const Scene masked = masked_square(AlphaMode::mask);
  TracerOptions off;
  off.alpha_test = false;
  const Tracer tracer(masked, off);
  RayCounters counters;
  EXPECT_TRUE(tracer.occluded(down_at(0.25f), counters));
  EXPECT_EQ(counters.filter_calls, 0u);
}

TEST(AlphaTest, FactorAndVertexColourCountToo) {
  Material material;
  material.alpha_mode = AlphaMode::mask;
  material.alpha = 0.8f;
  test::MeshData quad = test::make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  // Alpha falls from 1 at x = 0 to 0 at x = 1: 0.8 (1 - x) passes 0.5 at x = 0.375.
  quad.colors = {{1, 1, 1, 1}, {1, 1, 1, 0}, {1, 1, 1, 0}, {1, 1, 1, 1}};
  const Scene scene = test::raw_scene(quad, material);
  const Tracer tracer(scene, {});
  RayCounters counters;
  EXPECT_TRUE(tracer.occluded(down_at(0.36f), counters));
  EXPECT_FALSE(tracer.occluded(down_at(0.39f), counters));
  EXPECT_EQ(counters.texture_reads, 0u);
  EXPECT_GT(counters.filter_calls, 0u);
}

TEST(Texture, BilinearWeighsTexelCentres) {
  const Texture texture = half_transparent(false);
  EXPECT_FLOAT_EQ(sample_texture_alpha(texture, {0.25f, 0.5f}), 0);
  EXPECT_FLOAT_EQ(sample_texture_alpha(texture, {0.5f, 0.5f}), 0.5f);
  EXPECT_FLOAT_EQ(sample_texture_alpha(texture, {0.75f, 0.5f}), 1);
  EXPECT_FLOAT_EQ(sample_texture_alpha(half_transparent(true), {0.49f, 0.5f}), 0);
}

TEST(Texture, WrapsAsTheFormatSays) {
  Texture texture = half_transparent(true);
  EXPECT_EQ(sample_texture_alpha(texture, {-5, 0.5f}), 0);
  EXPECT_EQ(sample_texture_alpha(texture, {7, 0.5f}), 1);
  texture.wrap_s = WrapMode::repeat;
  EXPECT_EQ(sample_texture_alpha(texture, {-0.25f, 0.5f}), 1);
  EXPECT_EQ(sample_texture_alpha(texture, {3.25f, 0.5f}), 0);
  texture.wrap_s = WrapMode::mirrored_repeat;
  EXPECT_EQ(sample_texture_alpha(texture, {-0.25f, 0.5f}), 0);
  EXPECT_EQ(sample_texture_alpha(texture, {1.25f, 0.5f}), 1);
  for (const float odd : {NAN, INFINITY, -INFINITY, 3e38f})
    EXPECT_TRUE(std::isfinite(sample_texture_alpha(texture, {odd, odd})));
}

TEST(Texture, ColourIsDecodedBeforeFiltering) {
  Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.rgba = {0, 0, 0, 255, 255, 188, 128, 255};
  texture.wrap_s = WrapMode::clamp;
  const Vec4 middle = sample_texture(texture, {0.5f, 0.5f});
  EXPECT_NEAR(middle.x, 0.5f, 1e-6);
  EXPECT_NEAR(middle.y, 0.5 * 0.50289, 1e-5);  // sRGB 188
  EXPECT_NEAR(middle.z, 0.5 * 0.21586, 1e-5);  // sRGB 128
  EXPECT_EQ(middle.w, 1.0f);
}

TEST(Texture, TransformScalesThenRotatesThenMoves) {
  TextureSlot slot;
  slot.scale = {2, 3};
  slot.offset = {0.5f, 0.25f};
  Vec2 uv = transform_texcoord(slot, {1, 1});
  EXPECT_FLOAT_EQ(uv.x, 2.5f);
  EXPECT_FLOAT_EQ(uv.y, 3.25f);
  // A quarter turn counter-clockwise with v down takes +u to -v.
  slot = {};
  slot.rotation_rad = static_cast<float>(kPi / 2);
  uv = transform_texcoord(slot, {1, 0});
  EXPECT_NEAR(uv.x, 0, 1e-6);
  EXPECT_NEAR(uv.y, -1, 1e-6);
}

}  // namespace
}  // namespace lightkiln
