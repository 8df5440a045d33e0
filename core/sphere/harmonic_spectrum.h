#pragma once

// How much light each band holds, what is missing after n bands, and how many bands are enough.

#include <span>
#include <vector>

#include "core/base/progress.h"
#include "core/image/image.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

// Integral over the sphere of the squared radiance of a lat-long map, per channel: by Parseval the
// energy of all bands together, however fine the map.
Vec3d latlong_energy(const Image& map, int threads, Progress& progress);

// Errors of keeping only bands 0 .. n-1: rms over the sphere of the channel where it is largest,
// relative to the luminance of the mean (of radiance or of irradiance).
struct BandRow {
  int bands = 0;  // n
  Vec3d energy;   // of band n-1: sum over m of the squared radiance coefficients
  double radiance_rms = 0;
  double irradiance_rms = 0;
  // No direction's irradiance is further off than this.
  double irradiance_max = 0;
};

struct ShSpectrum {
  Vec3d total_energy;         // of all bands
  Vec3d mean;                 // radiance
  std::vector<BandRow> rows;  // n = 1, 2, ...
};

// Of `rows` bands. `energy` holds sum_m c_lm^2 of at least as many bands, `total` that of all
// bands, `mean` the mean radiance. What lies beyond the known bands counts in full for radiance,
// and for irradiance by the largest cosine factor there: under a small sun irradiance is told well
// only when many more bands are known than rows are wanted. A black map has zero errors.
ShSpectrum make_spectrum(std::span<const Vec3d> energy, const Vec3d& total, const Vec3d& mean,
                         int rows);

// The fewest bands whose rms error is at most `error`; 0 when more than the spectrum's rows are
// needed.
struct BandAdvice {
  double error = 0;
  int radiance_bands = 0, irradiance_bands = 0;
};
BandAdvice advise_bands(const ShSpectrum& spectrum, double error);

}  // namespace lightkiln
