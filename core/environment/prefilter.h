#pragma once

// Convolution of an environment with GGX and Charlie lobes and the clamped cosine, in the domain of
// spherical harmonics: no samples, no noise, and an error bound before the work starts. The core of
// a lobe too narrow for any affordable band limit is integrated over the map's texels instead.
//
//   LightStatistics light = measure_light(environment);
//   LobePlan lobe = plan_lobe(light, {LobeKind::ggx, alpha}, target);   // bands and bound
//   LatlongSpectrum spectrum = project_for(environment, lobes, ...);
//   Image cube = convolve_lobe(environment, light, spectrum, lobe, size, ...);

#include <cstdint>
#include <span>
#include <vector>

#include "core/environment/environment.h"
#include "core/environment/light_statistics.h"
#include "core/environment/lobe.h"
#include "core/sphere/harmonic_transform.h"

namespace lightkiln {

// How one lobe is convolved.
struct LobePlan {
  Lobe lobe;
  int bands = 0;                  // of the map that enter
  bool corrected = false;         // bright texels get what the band limit cuts off, in closed form
  double cell_phase = 0;          // how finely those are cut for it (see CutLight)
  double split = 0;               // above 0: the core is left to the map's texels (see GgxHalo)
  double tolerance = 0;           // of the core, relative; 0 without a core
  std::vector<double> responses;  // h_l for l < bands, of the lobe or of its halo
  double row_error = 0;           // what the map's rows may be summed to, part of error_bound
  double error_bound = 0;         // rms over the sphere, relative to the mean
  double uncorrected_bound = 0;   // what it would be without the correction
  // The truth lies in the map's range, so that results are cut back into it.
  bool within_range = true;
};
// The fewest bands whose bound stays at or under `target` (relative rms), what single precision
// takes aside. Where no allowed number does, the most are taken, and error_bound, then above
// `target`, says what that gives.
inline constexpr int kMaxBands = 1400;
// GGX lobes that would need more bands than these, or than a halo of this map, are split. Charlie's
// ring cannot be; it makes do with the bands that kDearTargets times the target takes, since time
// grows with their cube.
inline constexpr int kSplitBands = 800;
inline constexpr double kDearTargets = 2.5;
LobePlan plan_lobe(const LightStatistics& light, const Lobe& lobe, double target);

// The first `bands` bands of irradiance over pi and no more, as engines keep them: below 0 in
// places where a map's light is hard. `target` orders how exactly those are known.
LobePlan plan_irradiance_bands(const LightStatistics& light, int bands, double target);
// What the first `bands` bands of irradiance lack: rms over the sphere, and a bound on it in any
// direction, relative to the mean. `spectrum` holds at least as many bands.
struct OmittedLight {
  double rms = 0;
  double most = 0;
};
OmittedLight omitted_irradiance(const LightStatistics& light, const LatlongSpectrum& spectrum,
                                int bands);

// The grid that a level is read from: interpolating it is part of the bound.
int convolution_rings(int bands);
int convolution_longitudes(int bands);

// What coefficients serve beside lobes: themselves. Each errs by at most `error` of L00.
struct ShNeed {
  int bands;
  double error;
  ShNeed(int bands_ = 0, double error_ = 1e-8) : bands(bands_), error(error_) {}
};
// The fewest Gauss points per row of a map of `height` rows that all needs are met with.
int row_points(int height, std::span<const LobePlan> lobes, const ShNeed& sh);
// The map's coefficients for all of them.
LatlongSpectrum project_for(const Environment& environment, std::span<const LobePlan> lobes,
                            const ShNeed& sh, int threads, Progress& progress);

// What convolve_lobe() cut back into the range that the map spans; the truth lies inside it.
struct RangeReport {
  uint64_t texels = 0;
  double most = 0;  // relative to the mean luminance
};
// The lobe's average of the map, turned by what is pending, about the centre of every texel of a
// cube.
Image convolve_lobe(const Environment& environment, const LightStatistics& light,
                    const LatlongSpectrum& spectrum, const LobePlan& lobe, int face_size,
                    int threads, Progress& progress, RangeReport* range = nullptr);

}  // namespace lightkiln
