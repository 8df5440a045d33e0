#pragma once

// What a client orders of environment maps. Part of core/bake/spec.h.

#include <cstdint>
#include <optional>
#include <vector>

#include "core/bake/layout_orders.h"
#include "core/environment/roughness_scale.h"
#include "core/sphere/harmonic_exports.h"
#include "core/sphere/harmonic_window.h"

namespace lightkiln {

// Each product is made only when ordered.
struct ShOutput {
  int bands = 3;  // 1..129; cost grows with bands^2
  // none leaves the coefficients as projected. `minimal` searches the sphere, up to seconds at 129
  // bands; hann and lanczos cost nothing.
  ShWindow window = ShWindow::none;
  // The reconstruction that the window is for and is judged by. Radiance asks for more. Refused
  // without a window.
  ShQuantity window_quantity = ShQuantity::irradiance;
  // Linear bands with a zonal third one as well, from at least three bands before any window.
  bool zh3 = false;
  // Files for other engines, of the first three bands: bit i stands for kShTargets[i].
  uint32_t exports = 0;
};
// Energy by band, what is missing after n bands, and how many bands are enough.
struct SpectrumOutput {
  int bands = 33;  // 1..129 rows of the table; all cost the same, that of 257 bands of SH
};
enum class IrradianceMethod {
  exact,      // the whole map under the clamped cosine
  harmonics,  // its first bands alone, as engines keep them
};
struct IrradianceOutput {
  int size = 64;  // texels a face side, 1..1024; cost grows with size^2
  IrradianceMethod method = IrradianceMethod::exact;
  // Of harmonics, 1..33; none = 3. Refused by exact.
  std::optional<int> bands = {};
};
enum class Packaging {
  files,       // one file a level
  mip_mapped,  // one file of all levels
};
// A chain of cubes, each half the size of the one before: GGX (prefilter) or Charlie (sheen).
struct PrefilterOutput {
  int size = 256;  // texels a face side of level 0, power of two, 8..2048
  int levels = 5;  // 2..12, size >> (levels - 1) >= 1
  // How roughness runs from 0 to 1 over the levels. Low ones cost most.
  RoughnessScale roughness_scale = RoughnessScale::linear;
  // Of custom, one a level, 0..1 (sheen: 0.1..1). Empty and refused otherwise.
  std::vector<double> roughness = {};
  Packaging packaging = Packaging::files;
};
struct DfgOutput {
  int size = 128;  // texels a side, 8..1024
  // Channels for energy compensation instead of the plain split sum.
  bool multiple_scattering = false;
  bool charlie = false;  // sheen's albedo in the third channel, which is 0 otherwise
};

// Which roughness a level of the asset holds.
enum class AssetRoughness {
  linear,   // level / (levels - 1): what the extension's text says
  babylon,  // size^((level / (levels - 1) - 1) / 2): what Babylon.js 9 looks up
};
struct AssetOutput {
  // Texels a face side of level 0, power of two, 32..1024; levels halve it down to 16. Cost and
  // file grow with size^2.
  int size = 256;
  AssetRoughness roughness = AssetRoughness::linear;
  // Of the nine coefficients, for irradiance, which is all that they give; as of ShOutput.
  ShWindow window = ShWindow::none;
};
// Takes the brightest compact source out of the map, so that every other output is of the rest.
struct SunOrder {
  // How far the source may reach from its centre: above 0 to 10. A wider one stays in the map.
  double max_angular_radius_degrees = 2.5;
  // How many times as bright as the level at which it stands off its surroundings: 1..1000.
  double min_contrast = 5;
};
// Directional lights that stand for the map.
struct LightSetOutput {
  // 1..256. None = the fewest of 1, 2, 4, .. 256 whose irradiance has an rms error of at most
  // target_error; 256 if none has.
  std::optional<int> lights;
};

struct EnvironmentMapsParameters {
  SourceParameters source;
  RotationParameters rotation;
  std::optional<ShOutput> sh;
  std::optional<IrradianceOutput> irradiance;
  std::optional<PrefilterOutput> prefilter;
  std::optional<PrefilterOutput> sheen;
  std::optional<DfgOutput> dfg;
  std::optional<SpectrumOutput> spectrum;
  std::optional<AssetOutput> asset;
  LayoutOrders layouts;  // by product, see layout_orders.h
  CubeParameters cubes;
  std::optional<LightSetOutput> light_set;
  std::optional<SunOrder> sun;
  // At least one of these is ordered.
};

}  // namespace lightkiln
