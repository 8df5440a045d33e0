#include "core/trace/punctual.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

PunctualLight light(LightKind kind, float intensity, const Vec3d& position,
                    const Vec3d& direction = {0, -1, 0}) {
  PunctualLight made;
  made.kind = kind;
  made.intensity = {intensity, intensity, intensity};
  made.position = position;
  made.direction = direction;
  return made;
}

// What the floor point (x, 0, 0) shows of the lights; the floor is 40 m across and grey 0.5.
double floor_radiance(const std::vector<PunctualLight>& lights, float x,
                      const MeshData& blocker = {}) {
  SceneData data;
  data.parts.push_back({make_floor(20), grey(0.5f), {}});
  if (!blocker.triangles.empty()) data.parts.push_back({blocker, grey(0), {}});
  data.lights = lights;
  const LitScene lit(data, {}, bounces(1));
  const Estimate seen = estimate(lit, lit.ray({x, 5, 9}, {0, -5, -9}), 4);
  EXPECT_LE(seen.half_width, 1e-6 * seen.mean.x);
  return seen.mean.x;
}

// rho / pi I cos / d^2 = rho / pi I h / (h^2 + x^2)^(3/2), in metres whatever the scene's size.
TEST(Punctual, PointLightOverAPlane) {
  for (const float x : {0.0f, 1.0f, 7.5f}) {
    const double d2 = 9 + static_cast<double>(x) * static_cast<double>(x);
    const double truth = 0.5 / kPi * 30 * 3 / std::pow(d2, 1.5);
    EXPECT_NEAR(floor_radiance({light(LightKind::point, 30, {0, 3, 0})}, x), truth, 1e-5 * truth);
  }
}

TEST(Punctual, PointLightEndsAtItsRange) {
  PunctualLight lamp = light(LightKind::point, 30, {0, 3, 0});
  lamp.range = 6;
  const double truth = 0.5 / kPi * 30 / 9 * (1 - std::pow(0.5, 4));
  EXPECT_NEAR(floor_radiance({lamp}, 0), truth, 1e-5 * truth);
  EXPECT_EQ(floor_radiance({lamp}, 6), 0);
}

TEST(Punctual, PointLightIsBlocked) {
  const MeshData plate = make_quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2});
  const PunctualLight lamp = light(LightKind::point, 30, {0, 3, 0});
  EXPECT_EQ(floor_radiance({lamp}, 0, plate), 0);
  EXPECT_GT(floor_radiance({lamp}, 5, plate), 0);
}

// Full inside the inner cone, nothing outside the outer one, squared ramp of the cosine between.
TEST(Punctual, SpotLightFollowsItsCone) {
  PunctualLight spot = light(LightKind::spot, 30, {0, 3, 0});
  spot.inner_cone_rad = 0.3;
  spot.outer_cone_rad = 0.8;
  for (const double angle : {0.0, 0.25, 0.5, 0.7, 0.85}) {
    const double x = 3 * std::tan(angle);
    const double ramp =
        std::clamp((std::cos(angle) - std::cos(0.8)) / (std::cos(0.3) - std::cos(0.8)), 0.0, 1.0);
    const double truth = 0.5 / kPi * 30 * 3 / std::pow(9 + x * x, 1.5) * ramp * ramp;
    EXPECT_NEAR(floor_radiance({spot}, static_cast<float>(x)), truth, 1e-4 * truth + 1e-9) << angle;
  }
}

TEST(Punctual, DirectionalLightIsLambertsLaw) {
  const Vec3d down = normalize(Vec3d{1, -2, 0.5});
  const double truth = 0.5 / kPi * 4 * -down.y;
  EXPECT_NEAR(floor_radiance({light(LightKind::directional, 4, {}, down)}, 2), truth, 1e-5 * truth);
  EXPECT_EQ(floor_radiance({light(LightKind::directional, 4, {}, -down)}, 2), 0);
}

// Of more lights than each get a ray one is drawn: the mean stays the sum.
TEST(Punctual, ManyLightsAreDrawnWithoutBias) {
  SceneData data;
  data.parts.push_back({make_floor(20), grey(0.5f), {}});
  double truth = 0;
  for (int i = 0; i < 12; ++i) {
    const double x = i - 5.5;
    data.lights.push_back(light(LightKind::point, static_cast<float>(1 + i), {x, 3, 0}));
    truth += 0.5 / kPi * (1 + i) * 3 / std::pow(9 + x * x, 1.5);
  }
  const LitScene lit(data, {}, bounces(1));
  const Estimate seen = estimate(lit, lit.ray({0, 5, 9}, {0, -5, -9}), 1024);
  EXPECT_NEAR(seen.mean.x, truth, 2 * seen.half_width + 1e-5);
  EXPECT_LE(seen.half_width, 0.01 * truth);
}

}  // namespace
}  // namespace lightkiln::test
