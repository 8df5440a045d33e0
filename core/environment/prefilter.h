#pragma once

// Convolution of an environment with GGX lobes and the clamped cosine, in the domain of spherical
// harmonics: no samples, no noise, and an error bound before the work starts.
//
//   LightStatistics light = measure_light(environment);
//   LobePlan lobe = plan_lobe(light, alpha, target);         // bands and bound
//   LatlongSpectrum spectrum = project_for(environment, lobes, ...);
//   Image cube = convolve_lobe(light, spectrum, lobe, size, ...);

#include <cstdint>
#include <span>
#include <vector>

#include "core/environment/environment.h"
#include "core/environment/ggx_lobe.h"
#include "core/sphere/harmonic_transform.h"

namespace lightkiln {

// A texel so bright that what a band limit cuts off it would be seen.
struct BrightTexel {
  Vec3d direction;
  Vec3d energy;       // radiance times solid angle
  double extent_rad;  // the longer side
};

struct LightStatistics {
  Vec3 lowest, highest;  // per channel: no convolution leaves this range
  Vec3d mean;
  double mean_luminance = 0;
  // Standard deviation over the sphere relative to mean_luminance (largest channel), with and
  // without the bright texels; their share of all energy.
  double spread = 0;
  double rest_spread = 0;
  double bright_share = 0;
  std::vector<BrightTexel> bright;  // at most kMaxBrightTexels, brightest first
};
inline constexpr int kMaxBrightTexels = 96;
LightStatistics measure_light(const Environment& environment);

// How one lobe is convolved.
struct LobePlan {
  double alpha = 0;
  int bands = 0;                  // of the map that enter
  bool corrected = false;         // bright texels get what the band limit cuts off, in closed form
  std::vector<double> responses;  // h_l for l < bands
  double error_bound = 0;         // rms over the sphere, relative to the mean
  double uncorrected_bound = 0;   // what it would be without the correction
};
// The fewest bands whose bound stays at or under `target` (relative rms). Where no allowed number
// does, the most are taken, and error_bound, then above `target`, says what that gives.
inline constexpr int kMaxBands = 1400;
LobePlan plan_lobe(const LightStatistics& light, double alpha, double target);

// The map's coefficients for all `lobes` and for `sh_bands` bands at full accuracy.
LatlongSpectrum project_for(const Environment& environment, std::span<const LobePlan> lobes,
                            int sh_bands, int threads, Progress& progress);

// What convolve_lobe() cut back into the range that the map spans; the truth lies inside it.
struct RangeReport {
  uint64_t texels = 0;
  double most = 0;  // relative to the mean luminance
};
// The lobe's average of the map about the centre of every texel of a cube.
Image convolve_lobe(const LightStatistics& light, const LatlongSpectrum& spectrum,
                    const LobePlan& lobe, int face_size, int threads, Progress& progress,
                    RangeReport* range = nullptr);

}  // namespace lightkiln
