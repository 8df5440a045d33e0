#pragma once

// Nine coefficients as other engines hold them: their sign, scale, order and axes.

#include <array>
#include <span>
#include <vector>

#include "core/sphere/harmonics.h"

namespace lightkiln {

enum class ShTarget { three, filament, unity, unreal, babylon, godot, ext_lights_image_based };
inline constexpr ShTarget kShTargets[] = {ShTarget::three,
                                          ShTarget::filament,
                                          ShTarget::unity,
                                          ShTarget::unreal,
                                          ShTarget::babylon,
                                          ShTarget::godot,
                                          ShTarget::ext_lights_image_based};
const char* sh_target_name(ShTarget target);

// The target's world axes in terms of ours (right-handed, +Y up, +Z forward): engine = rows * ours.
// Importers of glTF turn models the same way, so that light and model stay together.
//   three, Filament, Godot: ours.  Unity: (-x, y, z).  Unreal: (x, z, y).
//   Babylon.js and EXT_lights_image_based: (-x, y, z), the left-handed world into which Babylon.js
//   loads glTF and in which cube maps are looked up.
std::array<Vec3d, 3> sh_target_axes(ShTarget target);

struct ShExport {
  ShTarget target = ShTarget::three;
  // R, G, B of (l, m) = 00 1-1 10 11 2-2 2-1 20 21 22 in the target's axes and convention:
  //   three    radiance, our basis
  //   filament irradiance / pi, times the constants of the basis ("pre-scaled")
  //   unity    irradiance / pi, times the constants of the basis
  //   unreal   radiance, basis with Condon-Shortley phase (odd m negated)
  //   babylon  irradiance / pi, basis with Condon-Shortley phase
  //   godot    radiance / pi, our basis
  //   ext_...  irradiance, basis with Condon-Shortley phase
  std::array<Vec3d, 9> coefficients;
  // A second form that the engine also takes. babylon: x y z xx yy zz yz zx xy of
  // SphericalPolynomial and of the `irradiance` member of .env files. Others: empty.
  std::vector<Vec3d> polynomial;
  // unreal: the seven float4 of SkyIrradianceEnvironmentMap. Others: empty.
  std::vector<std::array<double, 4>> packed;
  // Six normals in the target's axes with irradiance / pi there, which the engine multiplies by
  // albedo: for an importer to prove itself.
  struct Check {
    Vec3d normal, diffuse;
  };
  std::vector<Check> selftest;
};

// Of radiance coefficients; bands beyond the third are left out, missing ones count as 0.
ShExport export_sh(const ShRgb& radiance, ShTarget target);

}  // namespace lightkiln
