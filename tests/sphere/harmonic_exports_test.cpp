// Each engine's own formula on our export against our irradiance, with an asymmetric lobe in every
// coefficient alone: a swapped, negated or mis-scaled one shows as such.

#include "core/sphere/harmonic_exports.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/reference/engine_sh.h"

namespace lightkiln {
namespace {

Vec3d random_direction(uint64_t key, uint32_t index) {
  const Point2 p = sobol2(key, index);
  const double z = 1 - 2.0 * p.x, r = std::sqrt(1 - z * z), phi = 2 * kPi * p.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Vec3d in_engine(ShTarget target, const Vec3d& d) {
  const auto axes = sh_target_axes(target);
  return {dot(axes[0], d), dot(axes[1], d), dot(axes[2], d)};
}

std::vector<double> channel_major(const ShExport& sh) {
  std::vector<double> flat;
  for (int channel = 0; channel < 3; ++channel) {
    for (const Vec3d& c : sh.coefficients) flat.push_back(c[channel]);
  }
  return flat;
}

// Irradiance / pi by the engine's published formula, for a normal in our axes.
Vec3d engine_diffuse(const ShExport& sh, const Vec3d& normal) {
  const Vec3d n = in_engine(sh.target, normal);
  switch (sh.target) {
    case ShTarget::three:
      return reference::three_irradiance(sh.coefficients, n) / kPi;
    case ShTarget::filament:
      return reference::filament_diffuse(sh.coefficients, n);
    case ShTarget::unity:
      return reference::unity_diffuse(channel_major(sh), n);
    case ShTarget::unreal:
      return reference::unreal_diffuse(reference::unreal_pack(sh.coefficients), n);
    case ShTarget::babylon:
      return reference::babylon_diffuse(sh.coefficients, n);
    case ShTarget::godot:
      return reference::godot_diffuse(sh.coefficients, n);
    case ShTarget::ext_lights_image_based:
      return reference::ext_lights_image_based_diffuse(sh.coefficients, n);
  }
  return {};
}

// The first coefficient whose unit function the engine evaluates wrongly, -1 when none.
int first_wrong(ShTarget target, const std::function<void(ShExport&)>& spoil = {}) {
  for (int i = 0; i < 9; ++i) {
    ShRgb unit(3);
    unit.coefficients[static_cast<size_t>(i)] = {1, -2, 0.5};
    ShExport sh = export_sh(unit, target);
    if (spoil) spoil(sh);
    for (uint32_t k = 0; k < 24; ++k) {
      const Vec3d n = random_direction(11, k);
      // The engines print six digits.
      if (length(engine_diffuse(sh, n) - sh_irradiance(unit, n) / kPi) > 5e-6) return i;
    }
  }
  return -1;
}

TEST(HarmonicExports, EveryEngineSeesOurIrradianceInEveryCoefficient) {
  for (const ShTarget target : kShTargets) {
    EXPECT_EQ(first_wrong(target), -1) << sh_target_name(target);
  }
}

// Irradiance / pi by the engine's formula at a normal in its own axes.
TEST(HarmonicExports, CarryASelftestThatTheEnginePasses) {
  ShRgb sky(5);
  for (uint32_t i = 0; i < 25; ++i) sky.coefficients[i] = Vec3d{1, 2, 3} * (sobol2(6, i).x - 0.5);
  for (const ShTarget target : kShTargets) {
    const ShExport sh = export_sh(sky, target);
    ASSERT_EQ(sh.selftest.size(), 6u);
    for (const auto& [normal, diffuse] : sh.selftest) {
      EXPECT_NEAR(length(normal), 1, 1e-15);
      const auto axes = sh_target_axes(target);
      const Vec3d ours = axes[0] * normal.x + axes[1] * normal.y + axes[2] * normal.z;
      EXPECT_LT(length(engine_diffuse(sh, ours) - diffuse), 1e-5) << sh_target_name(target);
    }
  }
}

// Positive control: what a furnace or a symmetric sky cannot see.
TEST(HarmonicExports, WouldShowASwapASignAndAFactorOfPi) {
  const auto swap = [](ShExport& sh) { std::swap(sh.coefficients[6], sh.coefficients[7]); };
  const auto negate = [](ShExport& sh) { sh.coefficients[5] *= -1; };
  const auto scale = [](ShExport& sh) { sh.coefficients[0] *= kPi; };
  for (const ShTarget target : kShTargets) {
    EXPECT_NE(first_wrong(target, swap), -1) << sh_target_name(target);
    EXPECT_NE(first_wrong(target, negate), -1) << sh_target_name(target);
    EXPECT_EQ(first_wrong(target, scale), 0) << sh_target_name(target);
  }
}

TEST(HarmonicExports, TurnAxesAsTheEnginesImportersOfGltfDo) {
  // Left of +Z, seen from inside, lies +X: in a left-handed world of +Y up that is -X.
  EXPECT_EQ(in_engine(ShTarget::unity, {1, 2, 3}), (Vec3d{-1, 2, 3}));
  EXPECT_EQ(in_engine(ShTarget::babylon, {1, 2, 3}), (Vec3d{-1, 2, 3}));
  EXPECT_EQ(in_engine(ShTarget::unreal, {1, 2, 3}), (Vec3d{1, 3, 2}));
  EXPECT_EQ(in_engine(ShTarget::godot, {1, 2, 3}), (Vec3d{1, 2, 3}));
}

TEST(HarmonicExports, ThreeReadsTheRadianceToo) {
  ShRgb sky(3);
  for (uint32_t i = 0; i < 9; ++i) sky.coefficients[i] = Vec3d{1, 2, 3} * (sobol2(7, i).x - 0.5);
  const ShExport sh = export_sh(sky, ShTarget::three);
  for (uint32_t k = 0; k < 16; ++k) {
    const Vec3d n = random_direction(12, k);
    EXPECT_LT(length(reference::three_radiance(sh.coefficients, n) - sh_evaluate(sky, n)), 1e-5);
  }
}

TEST(HarmonicExports, BabylonsPolynomialComesBackAsItsHarmonics) {
  ShRgb sky(3);
  for (uint32_t i = 0; i < 9; ++i) sky.coefficients[i] = Vec3d{1, 2, 3} * (sobol2(8, i).x - 0.5);
  const ShExport sh = export_sh(sky, ShTarget::babylon);
  ASSERT_EQ(sh.polynomial.size(), 9u);
  const auto harmonics = reference::babylon_from_polynomial(sh.polynomial);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_LT(length(harmonics[i] - sh.coefficients[i]), 1e-5) << i;
  }
}

TEST(HarmonicExports, UnrealsPackingIsTheEngines) {
  ShRgb sky(3);
  for (uint32_t i = 0; i < 9; ++i) sky.coefficients[i] = Vec3d{1, 2, 3} * (sobol2(9, i).x - 0.5);
  const ShExport sh = export_sh(sky, ShTarget::unreal);
  const auto packed = reference::unreal_pack(sh.coefficients);
  ASSERT_EQ(sh.packed.size(), packed.size());
  for (size_t i = 0; i < packed.size(); ++i) {
    for (size_t k = 0; k < 4; ++k) EXPECT_NEAR(sh.packed[i][k], packed[i][k], 1e-14);
  }
}

// A constant sky of radiance 1: Filament's and Unity's first coefficient is the mean, 1.
TEST(HarmonicExports, KeepTheMeanWhereTheEngineExpectsIt) {
  ShRgb white(1);
  white.coefficients[0] = Vec3d{1, 1, 1} * (2 * std::sqrt(kPi));
  EXPECT_NEAR(export_sh(white, ShTarget::filament).coefficients[0].x, 1, 1e-15);
  EXPECT_NEAR(export_sh(white, ShTarget::unity).coefficients[0].y, 1, 1e-15);
  EXPECT_NEAR(export_sh(white, ShTarget::three).coefficients[0].z, 3.544908, 1e-6);
  EXPECT_NEAR(export_sh(white, ShTarget::ext_lights_image_based).coefficients[0].x, kPi * 3.544908,
              1e-5);
  for (const ShTarget target : kShTargets) {
    for (size_t i = 1; i < 9; ++i) {
      EXPECT_EQ(length(export_sh(white, target).coefficients[i]), 0);
    }
  }
}

}  // namespace
}  // namespace lightkiln
