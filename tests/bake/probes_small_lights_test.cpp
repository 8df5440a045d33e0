// Light too small for points in texels or for scattered rays: what a bake tells of its error holds
// against a much finer bake of another seed, because the light is looked for. With looking switched
// off, the same samples claim an error within the order, and are wrong.

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "core/bake/probe_cube.h"
#include "core/base/random.h"
#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

constexpr double kOrder = 0.1;
constexpr uint64_t kMostSamples = 4096;
constexpr uint64_t kTruthSamples = 8192;
constexpr int kSize = 4;

struct Cube {
  std::vector<double> values;  // luminances of texels
  double told = 0;             // bound on the error, absolute
  bool trusted = true;         // neither suspicious nor short of samples
};

using Change = std::function<void(EffectSelection&)>;

struct Case {
  SceneData data;
  Vec3d probe;
  int bounces = 0;
  Change off;  // the treatment
};

// Doubles as a bake does until the bound is within `target`, from `fewest` samples on.
Cube sample(const LitScene& lit, const Vec3d& probe, uint64_t seed, double target, uint64_t fewest,
            uint64_t most) {
  static const CubeTexels texels = all_texels(kSize);
  const Vec3 origin = to_float(lit.scene.normalisation.to_normalised(probe));
  CubeSampling sampling(*lit.radiance, texels, origin, hash_combine(seed, 31), 0, 2);
  Progress progress;
  Cube cube;
  do {
    sampling.advance(progress, 0, 1);
    cube.told = sampling.error().bound(kLookConfidence);
  } while (sampling.samples() < fewest || (cube.told > target && 2 * sampling.samples() <= most));
  for (size_t i = 0; i < texels.texels.size(); ++i) {
    cube.values.push_back(luminance(to_double(sampling.texel(i))));
  }
  cube.trusted = cube.told <= target && !sampling.suspicious();
  return cube;
}

double mean(const Cube& cube) {
  static const CubeTexels texels = all_texels(kSize);
  double sum = 0;
  for (size_t i = 0; i < cube.values.size(); ++i) sum += texels.shares[i] * cube.values[i];
  return sum;
}

double distance(const Cube& a, const Cube& b) {
  static const CubeTexels texels = all_texels(kSize);
  double sum = 0;
  for (size_t i = 0; i < a.values.size(); ++i) {
    sum += texels.shares[i] * (a.values[i] - b.values[i]) * (a.values[i] - b.values[i]);
  }
  return std::sqrt(sum);
}

// Errors are relative to the truth's mean luminance, as in a bake.
void expect_honest(const Case& given, const char* what) {
  LitScene lit(given.data, {}, bounces(given.bounces));
  const Cube truth = sample(lit, given.probe, 1000, 0, kTruthSamples, kTruthSamples);
  const double reference = mean(truth);
  ASSERT_GT(reference, 0) << what;
  const uint64_t fewest = 512;  // of a cube of this size
  const double rounding = 1e-3 * kOrder * reference;
  int trusted = 0, kept = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const Cube cube = sample(lit, given.probe, seed, kOrder * reference, fewest, kMostSamples);
    trusted += cube.trusted;
    kept += distance(cube, truth) <= std::hypot(cube.told, truth.told) + rounding;
  }
  EXPECT_EQ(trusted, 8) << what;
  EXPECT_GE(kept, 7) << what;  // of a bound that holds 95 times in a hundred
  // Control: off, most bakes claim to be within the order and are not.
  lit.prepare(bounces(given.bounces), given.off);
  int wrong = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const Cube cube = sample(lit, given.probe, seed, kOrder * reference, fewest, kMostSamples);
    wrong += cube.trusted && distance(cube, truth) > kOrder * reference;
  }
  EXPECT_GE(wrong, 4) << what;
}

// A wall of which one texel shines, the others in `dim` (sRGB, of 255).
SceneData hot_wall(uint8_t dim, int size) {
  SceneData data = room(0.5f, 0);
  Texture texture;
  texture.width = texture.height = size;
  const auto side = static_cast<size_t>(size);
  texture.rgba.assign(4 * side * side, dim);
  std::fill_n(&texture.rgba[4 * (2 * side / 5 * side + side / 3)], 4, uint8_t{255});
  data.textures.push_back(texture);
  Material wall = grey(0.5f, 3000);
  wall.emissive_texture.texture = 0;
  data.parts.push_back({make_quad({-0.9f, -0.9f, -0.98f}, {1.8f, 0, 0}, {0, 1.8f, 0}), wall, {}});
  return data;
}

TEST(ProbesSmallLights, HotSpotOfATextureIsToldOf) {
  const Change off = [](EffectSelection& s) { s.emissive_sampling = false; };
  expect_honest({hot_wall(0, 1024), {0.1, 0.2, 0.3}, 1, off}, "hot spot");
  expect_honest({hot_wall(1, 256), {0.1, 0.2, 0.3}, 1, off}, "hot spot on a dim wall");
}

TEST(ProbesSmallLights, UnlitObjectIsToldOf) {
  SceneData data = room(0.5f, 0.0002f);
  Material sign = grey(1);
  sign.unlit = true;
  data.parts.push_back({make_quad({0.3f, 0.2f, -0.7f}, {0.01f, 0, 0}, {0, 0.01f, 0}), sign, {}});
  const Change off = [](EffectSelection& s) { s.unlit = false; };
  expect_honest({data, {0, 0, 0}, 2, off}, "unlit");
  // Beside an unlit surface ten thousand times as large, and from behind.
  data.parts.back().mesh = translated(data.parts.back().mesh, {0, 0, 1.4f});
  sign.base_color = {0.0004f, 0.0004f, 0.0004f};
  data.parts.push_back({make_quad({-0.9f, 0.9f, -0.9f}, {1.8f, 0, 0}, {0, 0, 1.8f}), sign, {}});
  expect_honest({data, {0.1, -0.2, 0}, 2, off}, "unlit beside a large one");
}

// The spot light's cone is as wide as 8 mm at its end. `behind`: a wall hides the patch, so that
// the probe sees only what the patch lights.
SceneData spot_room(bool behind) {
  SceneData data = room(0.6f, 0);
  if (behind) {
    data.parts.push_back({make_box({-0.02f, -1, -1}, {0.02f, 0.6f, 1}), grey(0.6f), {}});
  }
  PunctualLight spot;
  spot.kind = LightKind::spot;
  spot.intensity = {30000, 30000, 30000};
  spot.position = {0.5, 0.9, 0.1};
  spot.direction = {0, -1, 0};
  spot.inner_cone_rad = 0.001;
  spot.outer_cone_rad = 0.002;
  data.lights.push_back(spot);
  return data;
}

TEST(ProbesSmallLights, PatchOfASpotLightIsToldOf) {
  const Change off = [](EffectSelection& s) { s.punctual_patches = false; };
  expect_honest({spot_room(false), {-0.4, 0.1, 0.2}, 1, off}, "patch seen");
  expect_honest({spot_room(true), {-0.4, 0.1, 0.2}, 3, off}, "patch by bounce");
}

// The mean luminance over the sphere, by the first harmonic.
double mean_seen(const LitScene& lit, const Vec3d& probe) {
  const CubeTexels texels = all_texels(kSize);
  const Vec3 origin = to_float(lit.scene.normalisation.to_normalised(probe));
  CubeSampling sampling(*lit.radiance, texels, origin, 3, 1, 2);
  Progress progress;
  while (sampling.samples() < 4096) sampling.advance(progress, 0, 1);
  return luminance(sampling.harmonics().coefficients[0]) / std::sqrt(4 * kPi);
}

// What is found directly has the right size: far away, radiance times area times cosine over the
// squared distance, of the whole sphere.
TEST(ProbesSmallLights, HaveTheirClosedForms) {
  const Vec3d probe{-0.4, 0.1, 0.2};
  // A cone of height h = 1 - cos(outer) whose ramp, at its steepest, is 1000 (cos - cos(outer)):
  // its flux is 2 pi I times the integral of (1000 x)^2 from 0 to h. The patch reflects rho / pi.
  const double h = 1 - std::cos(0.002);
  const double flux = 2 * kPi * 30000 * 1e6 * h * h * h / 3;
  const Vec3d to_patch = Vec3d{0.5, -1, 0.1} - probe;
  const double patch = 0.6 / kPi * flux * -to_patch.y / (std::pow(length(to_patch), 3) * 4 * kPi);
  const LitScene spot(spot_room(false), {}, bounces(1));
  EXPECT_NEAR(mean_seen(spot, probe) / patch, 1, 0.01);

  SceneData data = room(0, 0);
  Material sign = grey(1);
  sign.unlit = true;
  data.parts.push_back({make_quad({0.3f, 0.2f, -0.7f}, {0.01f, 0, 0}, {0, 0.01f, 0}), sign, {}});
  const LitScene shown(data, {}, bounces(0));
  const Vec3d to_sign = Vec3d{0.305, 0.205, -0.7} - probe;
  const double seen = 1e-4 * -to_sign.z / (std::pow(length(to_sign), 3) * 4 * kPi);
  EXPECT_NEAR(mean_seen(shown, probe) / seen, 1, 0.01);
}

}  // namespace
}  // namespace lightkiln::test
