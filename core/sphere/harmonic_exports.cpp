// Sources: three.js src/math/SphericalHarmonics3.js; Filament filament/include/filament/
// IndirectLight.h and libs/ibl/src/CubemapSH.cpp; Unity Graphics com.unity.render-pipelines.core
// ShaderLibrary/EntityLighting.hlsl and the manual's page on SphericalHarmonicsL2; Unreal Engine
// SHMath.h, SceneRendering.cpp (SetupSkyIrradianceEnvironmentMapConstants) and
// ReflectionEnvironmentShared.ush (GetSkySHDiffuse), GLTF/Source ConversionUtilities.h; Babylon.js
// Maths/sphericalPolynomial.ts and loaders/glTF/2.0/Extensions/EXT_lights_image_based.ts; Godot
// modules/lightmapper_rd/lm_compute.glsl and scene_forward_clustered.glsl; Sloan, "Stupid Spherical
// Harmonics Tricks", GDC 2008, appendix A10.

#include "core/sphere/harmonic_exports.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/harmonic_rotation.h"

namespace lightkiln {

namespace {

// The constants K of the basis in front of the polynomials 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2.
const std::array<double, 9>& basis_constants() {
  static const double one = std::sqrt(3 / (4 * kPi)), two = std::sqrt(15 / (4 * kPi));
  static const std::array<double, 9> constants = {
      std::sqrt(1 / (4 * kPi)),  one, one, one, two, two, std::sqrt(5 / (16 * kPi)), two,
      std::sqrt(15 / (16 * kPi))};
  return constants;
}

constexpr int kBand[9] = {0, 1, 1, 1, 2, 2, 2, 2, 2};
constexpr bool kOddOrder[9] = {false, true, false, true, false, true, false, true, false};

ShRgb first_three(const ShRgb& radiance) {
  ShRgb three(3);
  std::copy_n(radiance.coefficients.begin(),
              std::min(radiance.coefficients.size(), three.coefficients.size()),
              three.coefficients.begin());
  return three;
}

// The coefficients of g(d') = f(d), d' = axes * d. A reflection is a proper turn after the point
// inversion d -> -d, which negates the odd bands.
std::array<Vec3d, 9> in_axes(ShRgb three, const std::array<Vec3d, 3>& axes) {
  const bool mirrored = dot(cross(axes[0], axes[1]), axes[2]) < 0;
  double turn[3][3];
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      turn[row][column] = axes[static_cast<size_t>(row)][column] * (mirrored ? -1 : 1);
    }
  }
  three = sh_rotate(three, turn);
  std::array<Vec3d, 9> result;
  for (size_t i = 0; i < 9; ++i) {
    result[i] = three.coefficients[i] * (mirrored && kBand[i] == 1 ? -1.0 : 1.0);
  }
  return result;
}

// Babylon.js keeps E / pi of coefficients c as a quadratic form; its FromHarmonics folds the
// clamped cosine in once more and FromPolynomial takes it out again, so that the shader's harmonics
// come back. Written from FromPolynomial's inverse: with k_i = K_i A_l / pi
//   x = -k c_11, y = -k c_1-1, z = k c_10, xy = k c_2-2, yz = -k c_2-1, zx = -k c_21,
//   xx, yy = k c_00 - k c_20 +- k c_22, zz = k c_00 + 2 k c_20.
std::vector<Vec3d> babylon_polynomial(const std::array<Vec3d, 9>& c) {
  std::array<Vec3d, 9> k;
  for (size_t i = 0; i < 9; ++i) {
    const double sign = kOddOrder[i] ? -1 : 1;
    k[i] = c[i] * (sign * basis_constants()[i] * clamped_cosine_band(kBand[i]) / kPi);
  }
  return {k[3], k[1], k[2], k[0] - k[6] + k[8], k[0] - k[6] - k[8], k[0] + k[6] * 2.0,
          k[5], k[7], k[4]};
}

// Per channel (x, y, z, 1), then (xy, yz, zz, zx), then x^2 - y^2: Sloan's appendix A10.
std::vector<std::array<double, 4>> unreal_packed(const std::array<Vec3d, 9>& c) {
  std::array<Vec3d, 9> k;
  for (size_t i = 0; i < 9; ++i) {
    const double sign = kOddOrder[i] ? -1 : 1;
    k[i] = c[i] * (sign * basis_constants()[i] * clamped_cosine_band(kBand[i]) / kPi);
  }
  std::vector<std::array<double, 4>> packed;
  for (int channel = 0; channel < 3; ++channel) {
    packed.push_back({k[3][channel], k[1][channel], k[2][channel], k[0][channel] - k[6][channel]});
  }
  for (int channel = 0; channel < 3; ++channel) {
    packed.push_back({k[4][channel], k[5][channel], 3 * k[6][channel], k[7][channel]});
  }
  packed.push_back({k[8].x, k[8].y, k[8].z, 1.0});
  return packed;
}

}  // namespace

const char* sh_target_name(ShTarget target) {
  switch (target) {
    case ShTarget::three:
      return "three";
    case ShTarget::filament:
      return "filament";
    case ShTarget::unity:
      return "unity";
    case ShTarget::unreal:
      return "unreal";
    case ShTarget::babylon:
      return "babylon";
    case ShTarget::godot:
      return "godot";
    case ShTarget::ext_lights_image_based:
      return "ext_lights_image_based";
  }
  return "";
}

std::array<Vec3d, 3> sh_target_axes(ShTarget target) {
  switch (target) {
    case ShTarget::three:
    case ShTarget::filament:
    case ShTarget::godot:
      break;
    case ShTarget::unity:
    case ShTarget::babylon:
    case ShTarget::ext_lights_image_based:
      return {Vec3d{-1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
    case ShTarget::unreal:
      return {Vec3d{1, 0, 0}, Vec3d{0, 0, 1}, Vec3d{0, 1, 0}};
  }
  return {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
}

ShExport export_sh(const ShRgb& radiance, ShTarget target) {
  ShExport result;
  result.target = target;
  const ShRgb three = first_three(radiance);
  const std::array<Vec3d, 3> axes = sh_target_axes(target);
  result.coefficients = in_axes(three, axes);
  const bool phase = target == ShTarget::unreal || target == ShTarget::babylon ||
                     target == ShTarget::ext_lights_image_based;
  const bool prescaled = target == ShTarget::filament || target == ShTarget::unity;
  for (size_t i = 0; i < 9; ++i) {
    double scale = phase && kOddOrder[i] ? -1 : 1;
    const double cosine = clamped_cosine_band(kBand[i]);
    if (prescaled) scale *= basis_constants()[i] * cosine / kPi;
    if (target == ShTarget::babylon) scale *= cosine / kPi;
    if (target == ShTarget::ext_lights_image_based) scale *= cosine;
    if (target == ShTarget::godot) scale /= kPi;
    result.coefficients[i] *= scale;
  }
  if (target == ShTarget::babylon) result.polynomial = babylon_polynomial(result.coefficients);
  if (target == ShTarget::unreal) result.packed = unreal_packed(result.coefficients);
  // No axis and no mirror plane of the basis among them.
  const Vec3d directions[] = {{2, 3, 6},   {-6, 2, 3}, {3, -6, 2},
                              {-2, -3, 6}, {6, 2, -3}, {-3, 6, -2}};
  for (const Vec3d& direction : directions) {
    const Vec3d normal = direction / 7;
    result.selftest.push_back({{dot(axes[0], normal), dot(axes[1], normal), dot(axes[2], normal)},
                               sh_irradiance(three, normal) / kPi});
  }
  return result;
}

}  // namespace lightkiln
