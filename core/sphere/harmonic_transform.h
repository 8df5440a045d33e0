#pragma once

// From a lat-long image to spherical harmonics of any band limit and back to values on the sphere.
// The image is taken for what it is: a constant on the exact spherical rectangle of each texel.

#include <span>
#include <vector>

#include "core/base/progress.h"
#include "core/image/image.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

// RGB coefficients about the image's own axis, +Y, with longitude as azimuth: the frame in which a
// ring of texels is one Fourier series. World coefficients come from world_harmonics().
struct LatlongSpectrum {
  int bands = 0;
  // Six values per (l, m >= 0): cosine R, G, B, then sine R, G, B; orthonormal, no Condon-Shortley
  // phase. m-major: see offset().
  std::vector<double> coefficients;

  explicit LatlongSpectrum(int bands_ = 0)
      : bands(bands_),
        coefficients(6 * static_cast<size_t>(bands_) * static_cast<size_t>(bands_ + 1) / 2) {}
  size_t offset(int l, int m) const {
    const size_t order = static_cast<size_t>(m), limit = static_cast<size_t>(bands);
    return 6 * (order * limit - order * (order - 1) / 2 + static_cast<size_t>(l - m));
  }
};

// Gauss points per row of texels so that, for every band l, the error of integrating a row relative
// to the row, times weights[l], stays at or under `tolerance`.
int row_gauss_points(int height, std::span<const double> weights, double tolerance);

// What that many Gauss points per row leave of band l >= 1: the root of the sum over m of squared
// errors, relative to L00, for the worst map without negative values (all of its light at one
// place). `height` rows.
double row_band_error(int points, int l, int height);

// Coefficients of all bands l < bands, by a Fourier series along each row (texels as boxes: exact)
// and Legendre functions across rows (`gauss_points` per row). Cost: H W log W + H bands^2. The
// same bits for any number of threads.
LatlongSpectrum project_latlong(const Image& image, int bands, int gauss_points, int threads,
                                Progress& progress);

// The first `bands` bands in the world frame (polar axis +Z).
ShRgb world_harmonics(const LatlongSpectrum& spectrum, int bands);

// The way back: latlong_spectrum(world_harmonics(s, s.bands)) is s up to rounding.
LatlongSpectrum latlong_spectrum(const ShRgb& world);

// sum over m of the squared coefficients of each band, per channel.
std::vector<Vec3d> band_energy(const LatlongSpectrum& spectrum);

// Values on rings of equal colatitude, made for interpolation: ring j at colatitude
// (j + 1/2) pi / rings, point k at longitude 2 pi k / longitudes.
class RingGrid {
 public:
  // Interpolation reads kTaps points in each dimension.
  static constexpr int kTaps = 8;

  // Both counts even; at least twice and four times the bands keep interpolation_error() small.
  RingGrid(int rings, int longitudes);

  int rings() const { return rings_; }
  int longitudes() const { return longitudes_; }
  void set(int ring, int longitude, const float rgb[3]);
  const float* at(int ring, int longitude) const;  // R, G, B
  // Fills the margins that interpolation reads: wrapped in longitude, mirrored with half a turn
  // beyond the poles. To be called once every point is set.
  void close();
  // Lagrange interpolation of degree kTaps - 1 in both angles at a unit direction.
  Vec3d interpolate(const Vec3d& direction) const;
  // The direction of a point of the grid.
  Vec3d direction(int ring, int longitude) const;
  // The largest error of interpolating a harmonic of band l and unit amplitude.
  static double interpolation_error(int l, int rings, int longitudes);

 private:
  int rings_, longitudes_;
  int stride_;                 // points a row, margins included
  std::vector<float> pixels_;  // R, G, B, 0 a point
};

// sum_lm factors[l] c_lm y_lm at every point of the grid, over bands l < factors.size(): the
// spectrum convolved with the zonal kernel whose band responses are `factors`.
RingGrid synthesise_rings(const LatlongSpectrum& spectrum, std::span<const double> factors,
                          int rings, int longitudes, int threads, Progress& progress);

}  // namespace lightkiln
