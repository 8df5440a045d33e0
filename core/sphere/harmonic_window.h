#pragma once

// Windows: factors by band that trade contrast for less ringing.

#include <span>
#include <vector>

#include "core/base/progress.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

enum class ShWindow {
  none,
  hann,     // (1 + cos(pi l / bands)) / 2
  lanczos,  // sin(x) / x at x = pi l / bands
  minimal,  // 1 / (1 + lambda l^2 (l+1)^2), the smallest lambda without negative light
};
// Which reconstruction a window looks at. A radiance without negative values has an irradiance
// without them, but not the other way round: `radiance` asks for more.
enum class ShQuantity { radiance, irradiance };

// Factors of the bands 0 .. bands-1; the first is exactly 1.
std::vector<double> hann_factors(int bands);
std::vector<double> lanczos_factors(int bands);
// Sloan, "Stupid Spherical Harmonics Tricks", GDC 2008: the coefficients that minimise squared
// error plus lambda times the squared Laplacian.
std::vector<double> sloan_factors(int bands, double lambda);

// Extremes of a reconstruction over the sphere.
struct ShExtremes {
  double lowest = 0;         // of the channels, each relative to its own mean
  double luminance_min = 0;  // relative to the mean luminance
  double luminance_max = 0;
};

// What a window did.
struct ShWindowReport {
  ShWindow window = ShWindow::none;
  ShQuantity quantity = ShQuantity::irradiance;  // of `before`, `after` and `minimal`
  double lambda = 0;                             // of `minimal`
  std::vector<double> factors;                   // by band
  ShExtremes before, after;
  // The minimum of the result over sphere and channels is proven to be at least this, relative to
  // the channel's mean. Of `minimal` alone; 0 otherwise.
  double proven_lowest = 0;
  // Share of the energy of bands 1 and up that the window took, over all channels; and share of the
  // luminance's contrast, max - min over the sphere.
  double energy_removed = 0, contrast_removed = 0;
};
struct WindowedSh {
  ShRgb sh;  // radiance coefficients; L00 has the bits it had
  ShWindowReport report;
};

// Radiance coefficients, windowed. `none` returns them untouched and searches nothing. `minimal`
// reaches a minimum of at least -1e-6 of a channel's mean, with one lambda for all channels. No
// smaller lambda does: it is the smallest that is not negative at a finite set of directions.
// Throws Error{invalid_input} when a channel has light but no positive mean.
WindowedSh window_sh(const ShRgb& radiance, ShWindow window, ShQuantity quantity, int threads,
                     Progress& progress);

}  // namespace lightkiln
