#include "core/trace/radiance.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/environment/environment.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/reference/slow_path_tracer.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

const Vec3 kDirections[] = {{1, 0, 0},           {0, 1, 0},           {0, 0, -1},
                            {0.6f, -0.5f, 0.3f}, {-0.2f, 0.9f, 0.1f}, {-0.7f, -0.1f, -0.6f}};

SceneData one_part(const MeshData& mesh, const Material& material) {
  SceneData data;
  data.parts.push_back({mesh, material, {}});
  return data;
}

MeshData room() {
  return reversed(make_box({-1, -1, -1}, {1, 1, 1}));
}

// The sphere seen from inside, open above: triangles whose rings lie under ring `open` remain. The
// open cap's share of the whole sphere is (1 - cos(pi open / rings)) / 2.
MeshData bowl(int rings, int open) {
  MeshData mesh = reversed(make_sphere({0, 0, 0}, 1, rings, 2 * rings));
  const float edge = static_cast<float>(std::cos(kPi * open / rings)) + 1e-5f;
  std::erase_if(mesh.triangles, [&](const std::array<uint32_t, 3>& t) {
    return std::any_of(t.begin(), t.end(), [&](uint32_t i) { return mesh.positions[i].y > edge; });
  });
  return mesh;
}

// L = Le (1 - rho^(K+1)) / (1 - rho) in every direction, without variance.
TEST(Radiance, ClosedFurnaceIsExactForEveryNumberOfBounces) {
  for (const float albedo : {0.0f, 0.2f, 0.5f, 0.9f}) {
    LitScene lit(one_part(room(), grey(albedo, 1)), {}, bounces(0));
    for (const int count : {0, 1, 2, 3, 8, 40}) {
      lit.prepare(bounces(count));
      const double rho = static_cast<double>(albedo);
      const double truth = (1 - std::pow(rho, count + 1)) / (1 - rho);
      for (const Vec3& direction : kDirections) {
        const Estimate seen = estimate(lit, lit.ray({0.1f, 0.2f, -0.3f}, direction), 16);
        EXPECT_NEAR(seen.mean.y, truth, 1e-5 * truth) << albedo << " " << count;
        EXPECT_LE(seen.half_width, 1e-5 * truth);
      }
    }
  }
}

// The control of the furnace's calm: a room lit by one lamp is noisy.
TEST(Radiance, UnevenRoomHasVariance) {
  SceneData data = one_part(room(), grey(0.5f));
  data.parts.push_back({make_quad({-0.5f, 0.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}), grey(0, 1), {}});
  LitScene lit(data, {}, bounces(3));
  EXPECT_GT(estimate(lit, lit.ray({0, 0, 0}, {0, -1, 0}), 16).half_width, 1e-3);
}

TEST(Radiance, BouncesByBoundReachTheFurnacesLimit) {
  LitScene lit(one_part(room(), grey(0.5f, 1)), {}, {std::nullopt, 0.001, 2.0});
  const Estimate seen = estimate(lit, lit.ray({0, 0, 0}, {1, 0, 0}), 16);
  EXPECT_NEAR(seen.mean.y, 2.0, 0.0005 * 2.0);
  EXPECT_LT(seen.mean.y, 2.0);
  EXPECT_LE(seen.half_width, 1e-6);
}

// L(x) = Le(x) + rho <Le> / (1 - rho) on a sphere, <Le> the mean over its area.
TEST(Radiance, IntegratingSphereSpreadsAnyEmissionEvenly) {
  MeshData all = reversed(make_sphere({0, 0, 0}, 1, 96, 192)), cap = all, rest = all;
  const auto in_cap = [&](const std::array<uint32_t, 3>& t) {
    return (all.positions[t[0]].y + all.positions[t[1]].y + all.positions[t[2]].y) / 3 > 0.5f;
  };
  std::erase_if(cap.triangles, [&](const auto& t) { return !in_cap(t); });
  std::erase_if(rest.triangles, in_cap);
  SceneData data = one_part(rest, grey(0.6f));
  data.parts.push_back({cap, grey(0.6f, 3), {}});
  LitScene lit(data, {}, bounces(24));
  const double share = lit.survey.meshes[1].area / lit.survey.area;
  const double truth = 0.6 * 3 * share / 0.4;
  ASSERT_TRUE(lit.effects.selection.emissive_sampling);
  // The middle of a facet: elsewhere its normal leaves the sphere's by up to half a facet, which
  // tells at first order.
  const auto facet = [](int ring, int segment) {
    const double polar = kPi * (ring + 0.5) / 96, azimuth = 2 * kPi * (segment + 0.5) / 192;
    return to_float({std::sin(polar) * std::sin(azimuth), std::cos(polar),
                     std::sin(polar) * std::cos(azimuth)});
  };
  for (const Vec3& direction : {Vec3{0, -1, 0}, facet(48, 100), facet(70, 7)}) {
    const Estimate seen = estimate(lit, lit.ray({0, 0, 0}, direction), 1024);
    EXPECT_NEAR(seen.mean.x, truth, 0.002 * truth + 1.5 * seen.half_width);
    EXPECT_LE(seen.half_width, 0.01 * truth);
  }
  const Estimate bright = estimate(lit, lit.ray({0, 0, 0}, {0, 1, 0}), 1024);
  EXPECT_NEAR(bright.mean.x, 3 + truth, 0.005 * truth + 1.5 * bright.half_width);
}

// Bowl of open fraction f under a unit sky: rho f / (1 - rho (1 - f)) from anywhere inside.
TEST(Radiance, BowlUnderUniformSkyHasItsClosedForm) {
  const double rho = 0.9;
  for (const int open : {16, 24, 32}) {
    const double f = 0.5 * (1 - std::cos(kPi * open / 64));
    LitScene lit(one_part(bowl(64, open), grey(0.9f)), constant_environment({1, 1, 1}),
                 bounces(60));
    const double truth = rho * f / (1 - rho * (1 - f));
    for (const Vec3& direction : {Vec3{0, -1, 0}, Vec3{0.8f, -0.5f, 0.3f}}) {
      const Estimate seen = estimate(lit, lit.ray({0, 0, 0}, direction), 1024);
      EXPECT_NEAR(seen.mean.z, truth, 0.004 * truth + 1.5 * seen.half_width) << open;
      EXPECT_LE(seen.half_width, 0.01);
    }
  }
}

TEST(Radiance, ConvexBodyUnderUniformSkyShowsItsAlbedo) {
  LitScene lit(one_part(make_sphere({0, 0, 0}, 1), diffuse({0.2f, 0.5f, 0.8f})),
               constant_environment({1, 2, 3}), bounces(5));
  const Estimate seen = estimate(lit, lit.ray({0, 0, 3}, {0.1f, 0.05f, -1}), 64);
  EXPECT_NEAR(seen.mean.x, 0.2, 1e-5);
  EXPECT_NEAR(seen.mean.y, 1.0, 1e-5);
  EXPECT_NEAR(seen.mean.z, 2.4, 1e-5);
  EXPECT_LE(seen.half_width, 1e-6);
}

// The corner's form factor of a rectangle a x b at height h, x = a/h, y = b/h (Howell's catalogue).
double corner_form_factor(double x, double y) {
  const double p = std::sqrt(1 + x * x), q = std::sqrt(1 + y * y);
  return (x / p * std::atan(y / p) + y / q * std::atan(x / q)) / (2 * kPi);
}

// L = rho Le F for a small receiver under the middle of the lamp, F = 4 F(corner).
TEST(Radiance, EmissiveQuadOverAPlaneHasItsFormFactor) {
  const double truth = 0.5 * 10 * 4 * corner_form_factor(0.5, 0.5);
  for (const bool facing_down : {true, false}) {
    for (const bool double_sided : {true, false}) {
      for (const bool sampled : {true, false}) {
        const MeshData lamp = make_quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2});  // normal u x v = -Y
        Material material = grey(0, 10);
        material.double_sided = double_sided;
        SceneData data = one_part(make_floor(20), grey(0.5f));
        data.parts.push_back({facing_down ? lamp : reversed(lamp), material, {}});
        LitScene lit(data, {}, bounces(1));
        ASSERT_TRUE(lit.effects.selection.emissive_sampling);
        lit.prepare(bounces(1), [&](EffectSelection& s) { s.emissive_sampling = sampled; });
        const Estimate seen = estimate(lit, lit.ray({0, 1, 9}, {0, -1, -9}), 1024);
        const double expected = facing_down || double_sided ? truth : 0;
        EXPECT_NEAR(seen.mean.x, expected, 2 * seen.half_width + 1e-4);
        EXPECT_LE(seen.half_width, (sampled ? 0.004 : 0.03) * truth);
      }
    }
  }
}

// One texel of 32 x 16 a thousand times as bright as the rest.
Environment spotted_sky() {
  Environment sky = constant_environment({1, 1, 1});
  sky.constant = false;
  sky.radiance = Image(32, 16, 3);
  std::fill(sky.radiance.pixels.begin(), sky.radiance.pixels.end(), 1.0f);
  sky.radiance.at(9, 3)[0] = 1000;
  sky.radiance.at(9, 3)[1] = 800;
  sky.radiance.at(9, 3)[2] = 500;
  Vec3d sum;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 32; ++x) {
      sum += to_double(sky.radiance.rgb(x, y)) * latlong_texel_solid_angle(y, 32, 16);
    }
  }
  sky.mean = sum / (4 * kPi);
  sky.max_luminance = luminance(Vec3d{1000, 800, 500});
  return sky;
}

// rho / pi sum of L cos over the upper hemisphere, each texel by 16 x 16 points.
double lambert_under(const Environment& sky, double rho) {
  double sum = 0;
  for (int y = 0; y < 16 * 16; ++y) {
    const double row = latlong_texel_solid_angle(y, 32 * 16, 16 * 16);
    for (int x = 0; x < 32 * 16; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / 512, (y + 0.5) / 256);
      sum += std::max(d.y, 0.0) * row * static_cast<double>(sky.radiance.rgb(x / 16, y / 16).x);
    }
  }
  return rho / kPi * sum;
}

TEST(Radiance, ImportanceAndCosineSamplingAgree) {
  const SceneData data = one_part(make_floor(20), grey(0.5f));
  LitScene lit(data, spotted_sky(), bounces(1));
  const double truth = lambert_under(*lit.environment, 0.5);
  ASSERT_TRUE(lit.effects.selection.environment_sampling);
  const Ray ray = lit.ray({0, 5, 9}, {0, -5, -9});
  const Estimate importance = estimate(lit, ray, 1024);
  lit.prepare(bounces(1), [](EffectSelection& s) { s.environment_sampling = false; });
  const Estimate cosine = estimate(lit, ray, 4096);
  EXPECT_NEAR(importance.mean.x, truth, 2 * importance.half_width + 1e-3 * truth);
  EXPECT_NEAR(cosine.mean.x, truth, 2 * cosine.half_width);
  EXPECT_LE(importance.half_width, 0.01 * truth);
  EXPECT_GT(cosine.half_width, 2 * importance.half_width);
}

TEST(Radiance, DirectViewOfTheSkyIsItsTexel) {
  const LitScene lit(one_part(make_floor(1), grey(0.5f)), spotted_sky(), bounces(1));
  const Vec3d bright = latlong_direction(9.5 / 32, 3.5 / 16);
  RayCounters counters;
  const Vec3 seen = lit.radiance->sample(lit.ray({0, 1, 0}, to_float(bright)), 1, 0, counters);
  EXPECT_EQ(seen, (Vec3{1000, 800, 500}));
}

Texture checker() {
  Texture texture;
  texture.width = texture.height = 2;
  texture.nearest = true;
  texture.rgba = {255, 255, 255, 255, 0,   0,   0,   255,   // top row: white, black
                  255, 0,   0,   255, 188, 188, 188, 255};  // bottom: red, grey
  return texture;
}
const double kGrey = std::pow((188 / 255.0 + 0.055) / 1.055, 2.4);

// Each quarter of the floor shows its own texel times factor and vertex colour.
TEST(Radiance, AlbedoIsFactorTimesTextureTimesVertexColor) {
  MeshData floor = make_floor(1);
  floor.colors.assign(4, {1.0f, 0.5f, 0.25f, 1.0f});
  Material material = diffuse({0.8f, 0.8f, 0.8f});
  material.base_color_texture.texture = 0;
  SceneData data = one_part(floor, material);
  data.textures.push_back(checker());
  const LitScene lit(data, constant_environment({1, 1, 1}), bounces(1));
  ASSERT_TRUE(lit.effects.selection.textures && lit.effects.selection.vertex_colors);
  // make_floor's texture coordinates run along +X and -Z from the corner (-1, 0, 1).
  const auto seen = [&](float u, float v) {
    return estimate(lit, lit.ray({2 * u - 1, 1, 1 - 2 * v}, {0, -1, 0}), 16).mean;
  };
  EXPECT_NEAR(seen(0.25f, 0.25f).x, 0.8, 1e-5);
  EXPECT_NEAR(seen(0.25f, 0.25f).y, 0.4, 1e-5);
  EXPECT_NEAR(seen(0.25f, 0.25f).z, 0.2, 1e-5);
  EXPECT_EQ(seen(0.75f, 0.25f).x, 0);
  EXPECT_NEAR(seen(0.25f, 0.75f).x, 0.8, 1e-5);
  EXPECT_EQ(seen(0.25f, 0.75f).y, 0);
  EXPECT_NEAR(seen(0.75f, 0.75f).x, 0.8 * kGrey, 1e-5);
}

TEST(Radiance, TexturedLampEmitsItsTrueTexels) {
  const double quarter = 0.5 * 10 * corner_form_factor(0.5, 0.5);
  Material lamp = grey(0, 10);
  lamp.emissive_texture.texture = 0;
  SceneData data = one_part(make_floor(20), grey(0.5f));
  data.parts.push_back({make_quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}), lamp, {}});
  data.textures.push_back(checker());
  const LitScene lit(data, {}, bounces(1));
  const Estimate seen = estimate(lit, lit.ray({0, 1, 9}, {0, -1, -9}), 1024);
  // Under the middle all quarters weigh the same: white, red and grey shine in red.
  EXPECT_NEAR(seen.mean.x, quarter * (2 + kGrey), 3 * seen.half_width + 1e-4);
  EXPECT_NEAR(seen.mean.y, quarter * (1 + kGrey), 3 * seen.half_width + 1e-4);
}

// Holes neither shine nor block: half of the lamp is cut away, its light with it.
TEST(Radiance, MaskedLampShinesWhereItIs) {
  const double quarter = 0.5 * 10 * corner_form_factor(0.5, 0.5);
  Material lamp = grey(0, 10);
  lamp.alpha_mode = AlphaMode::mask;
  lamp.base_color_texture.texture = 0;
  SceneData data;
  data.parts.push_back({make_floor(20), grey(0.5f), {}});
  data.parts.push_back({make_quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}), lamp, {}});
  data.textures.push_back(checker());
  for (size_t texel : {0u, 2u}) data.textures[0].rgba[4 * texel + 3] = 0;
  for (const bool sampled : {true, false}) {
    LitScene lit(data, {}, bounces(1));
    lit.prepare(bounces(1), [&](EffectSelection& s) { s.emissive_sampling = sampled; });
    const Estimate seen = estimate(lit, lit.ray({0, 1, 9}, {0, -1, -9}), 1024);
    EXPECT_NEAR(seen.mean.x, 2 * quarter, 2 * seen.half_width + 1e-4);
    EXPECT_LE(seen.half_width, 0.06 * quarter);
  }
}

TEST(Radiance, UnlitSurfacesShowTheirColorAndTakeTheLight) {
  Material unlit = diffuse({0.3f, 0.6f, 0.9f}, {5, 5, 5});
  unlit.unlit = true;
  SceneData data = one_part(make_floor(20), grey(0.5f));
  data.parts.push_back({make_quad({-40, 1, -40}, {80, 0, 0}, {0, 0, 80}), unlit, {}});
  const LitScene lit(data, constant_environment({1, 1, 1}), bounces(4));
  EXPECT_NEAR(estimate(lit, lit.ray({0, 0.5f, 0}, {0, 1, 0}), 4).mean.y, 0.6, 1e-6);
  EXPECT_LT(estimate(lit, lit.ray({0, 0.5f, 0}, {0, -1, 0}), 64).mean.y, 0.01);
}

// A room with a lamp, a block and walls of three colours against a tracer that shares no code.
TEST(Radiance, AgreesWithTheSlowPathTracer) {
  const MeshData box = room();
  SceneData data;
  const Material walls[] = {diffuse({0.7f, 0.1f, 0.1f}), diffuse({0.1f, 0.7f, 0.1f}), grey(0.6f)};
  for (size_t face = 0; face < 6; ++face) {
    MeshData wall = box;
    wall.triangles = {box.triangles[2 * face], box.triangles[2 * face + 1]};
    data.parts.push_back({wall, walls[std::min<size_t>(face, 2)], {}});
  }
  data.parts.push_back(
      {make_quad({-0.4f, 0.95f, -0.4f}, {0.8f, 0, 0}, {0, 0, 0.8f}), grey(0.3f, 8), {}});
  data.parts.push_back({make_box({-0.6f, -1.0f, -0.5f}, {-0.1f, -0.2f, 0.1f}), grey(0.8f), {}});
  const LitScene lit(data, {}, bounces(4));
  for (const Vec3& direction : {Vec3{1, -0.2f, 0.1f}, Vec3{0.1f, 1, 0.8f}, Vec3{-0.3f, -1, 0.5f}}) {
    const Ray ray = lit.ray({0.2f, 0, 0.3f}, direction);
    const Estimate seen = estimate(lit, ray, 1024);
    const auto slow = reference::slow_radiance(lit.scene, {}, to_double(ray.origin),
                                               normalize(to_double(direction)), 4, 40000, 7);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(seen.mean[c], slow.mean[c], 4 * slow.standard_error[c] + 2 * seen.half_width);
    }
  }
}

TEST(Radiance, SurvivorsAreAnExactShareOfEveryRound) {
  for (uint32_t begin = 0, end = kFirstSamples; end <= 1024; begin = end, end *= 2) {
    const int most = most_halvings(begin);
    EXPECT_EQ(most, end - begin == 4 ? 2 : end - begin == 8 ? 3 : 4);
    for (int halvings = 0; halvings <= most; ++halvings) {
      uint32_t count = 0;
      for (uint32_t i = begin; i < end; ++i) count += survives(i, halvings);
      EXPECT_EQ(count, (end - begin) >> halvings);
    }
  }
  for (uint32_t i = 0; i < 4096; ++i) {
    for (int h = 1; h <= most_halvings(i); ++h) EXPECT_LE(survives(i, h), survives(i, h - 1));
  }
}

// Thinning deep vertices changes the noise, not the mean.
TEST(Radiance, HalvingIsUnbiased) {
  SceneData data = one_part(room(), grey(0.5f));
  data.parts.push_back({make_quad({-0.5f, 0.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}), grey(0.5f, 9), {}});
  LitScene lit(data, {}, bounces(10));
  ASSERT_LT(lit.effects.selection.halving[3], 10);
  const Ray ray = lit.ray({0, 0, 0}, {0.3f, 1, 0.9f});
  const Estimate thinned = estimate(lit, ray, 1024);
  lit.prepare(bounces(10), [](EffectSelection& s) { std::fill_n(s.halving, kMostHalvings, 99); });
  const Estimate full = estimate(lit, ray, 1024);
  EXPECT_NEAR(thinned.mean.x, full.mean.x, 1.5 * std::hypot(thinned.half_width, full.half_width));
}

}  // namespace
}  // namespace lightkiln::test
