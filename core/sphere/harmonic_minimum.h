#pragma once

// The smallest and the largest value of a band-limited function on the sphere.

#include <span>
#include <vector>

#include "core/base/progress.h"
#include "core/sphere/harmonic_transform.h"

namespace lightkiln {

// sum_m c_lm y_lm at a direction, each band apart: `parts` holds one value a band.
class ShBandParts {
 public:
  explicit ShBandParts(const ShRgb& sh);
  int bands() const { return bands_; }
  void evaluate(const Vec3d& direction, std::span<Vec3d> parts) const;

 private:
  int bands_;
  std::vector<double> sectoral_;      // Q_mm, with the factor sqrt2 of orders m > 0
  std::vector<double> grow_, keep_;   // the recurrence, order by order
  std::vector<double> coefficients_;  // cosine RGB, sine RGB, order by order
};

// A function in each of R, G, B, every channel divided by its own mean over the sphere, so that a
// value of 1 is the mean. Channels that are zero everywhere are left out.
class RelativeField {
 public:
  // Throws Error{invalid_input} when a channel's mean is not positive although it is not zero.
  explicit RelativeField(const ShRgb& sh);

  int bands() const { return parts_.bands(); }
  bool has_channel(int channel) const { return present_[channel]; }
  bool empty() const { return !present_[0] && !present_[1] && !present_[2]; }
  const ShBandParts& parts() const { return parts_; }
  const LatlongSpectrum& spectrum() const { return spectrum_; }
  // A bound on the second derivative along any great circle of sum_l factors[l] f_l: Bernstein's
  // inequality gives l^2 max |f_l| for a band, the addition theorem max |f_l| <=
  // sqrt((2l+1) / 4 pi) |c_l|.
  double curvature_bound(std::span<const double> factors) const;

 private:
  bool present_[3] = {false, false, false};
  ShBandParts parts_;
  LatlongSpectrum spectrum_;
  std::vector<double> band_norm_;  // largest |c_l| of the channels
};

struct FieldPoint {
  Vec3d direction;
  int channel = 0;
  double value = 0;
};

// The lowest local minima of sum_l factors[l] f_l over sphere and channels, ascending, at most
// `count`: local minima of a ring grid of eight points a wavelength, refined in double until they
// move less than 1e-6 of a wavelength. Negate the factors for maxima.
std::vector<FieldPoint> lowest_points(const RelativeField& field, std::span<const double> factors,
                                      size_t count, int threads, Progress& progress);

// A proof that sum_l factors[l] f_l is nowhere below `level` - `tolerance`, or a point below
// `level`
// - `tolerance` / 2. At the minimum the gradient vanishes, so a point at distance d from it lies at
// most curvature d^2 / 2 above: a cell of radius h whose centre exceeds `level` by more than
// curvature h^2 / 2 cannot hold anything lower and is dropped, the others are quartered. When that
// would take more than about a second, the bound reached by then is returned.
struct MinimumBound {
  double bound = 0;
  bool refuted = false;
  FieldPoint found;
};
MinimumBound bound_minimum(const RelativeField& field, std::span<const double> factors,
                           double level, double tolerance, int threads, Progress& progress);

}  // namespace lightkiln
