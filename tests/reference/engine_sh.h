#pragma once

// How engines evaluate the nine coefficients they are given: their published formulas with the
// constants they print, written out term by term. Each returns what the engine multiplies by albedo
// (irradiance / pi) or, where said, irradiance, for a normal in the ENGINE's axes.

#include <array>
#include <span>
#include <vector>

#include "core/base/math.h"

namespace lightkiln::reference {

using Nine = std::span<const Vec3d>;

// three.js, src/math/SphericalHarmonics3.js: getAt (radiance) and getIrradianceAt (irradiance).
Vec3d three_radiance(Nine c, const Vec3d& n);
Vec3d three_irradiance(Nine c, const Vec3d& n);

// Filament, libs/ibl/src/CubemapSH.cpp renderPreScaledSH3Bands and the material's shader.
Vec3d filament_diffuse(Nine c, const Vec3d& n);

// Unity, ShaderLibrary/EntityLighting.hlsl (SHEvalLinearL0L1, SHEvalLinearL2), with the shader
// constants unity_SHAr..unity_SHC packed from SphericalHarmonicsL2 as the engine packs them;
// flat[9 * channel + coefficient].
Vec3d unity_diffuse(std::span<const double> flat, const Vec3d& n);

// Unreal, SceneRendering.cpp's packing of FSHVectorRGB3 and GetSkySHDiffuse of
// ReflectionEnvironmentShared.ush.
std::vector<std::array<double, 4>> unreal_pack(Nine c);
Vec3d unreal_diffuse(std::span<const std::array<double, 4>> packed, const Vec3d& n);

// Babylon.js: harmonicsFunctions.fx on harmonics scaled by preScaleForRendering, and
// FromPolynomial, which turns the nine vectors of SphericalPolynomial (x y z xx yy zz yz zx xy)
// into harmonics.
Vec3d babylon_diffuse(Nine harmonics, const Vec3d& n);
std::vector<Vec3d> babylon_from_polynomial(Nine polynomial);
// EXT_lights_image_based as Babylon.js loads it: convertIrradianceToLambertianRadiance, then as
// above.
Vec3d ext_lights_image_based_diffuse(Nine coefficients, const Vec3d& n);

// Godot 4, scene_forward_clustered.glsl: probes of LightmapGI.
Vec3d godot_diffuse(Nine c, const Vec3d& n);

}  // namespace lightkiln::reference
