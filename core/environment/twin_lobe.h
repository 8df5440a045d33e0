#pragma once

// Lobes as the slow twin of a convolution reads them: values alone, and how fast they change.

#include <array>
#include <memory>
#include <optional>
#include <span>

#include "core/environment/lobe.h"

namespace lightkiln {

// A lobe of 1 - the cosine of the angle to its axis, which for the narrowest lobes the cosine
// itself could not tell. It integrates to 1 over the sphere.
class TwinLobe {
 public:
  virtual ~TwinLobe() = default;
  // Adds weight times the lobe at 1 - cosine = from + along x for every x of `places`. Where the
  // lobe has a horizon it is continued smoothly below it.
  virtual void add(double from, double along, double weight, std::span<const double> places,
                   double* values) const = 0;
  double at(double beside) const;
  // Over which distance it changes: around points at least `angle_rad` from the axis Gauss points
  // on a patch no larger than a share of this (see points_of) know its integral to kTwinError of
  // itself. It does not fall with the angle.
  virtual double width_rad(double angle_rad) const = 0;
  // Closer to its axis than this it holds less than kTwinEmpty of a white map.
  virtual double empty_rad() const { return 0; }
  // It vanishes below the horizon; without one it may be negative, and is at most this in size.
  virtual std::optional<double> largest() const { return std::nullopt; }
  bool has_horizon() const { return !largest(); }
};
std::unique_ptr<TwinLobe> make_twin_lobe(const Lobe& lobe);

// What the integral over any patch may err by, relative to itself.
inline constexpr double kTwinError = 1e-7;
inline constexpr double kTwinEmpty = 1e-9;

// A patch at most width / `shares` across takes `points` Gauss points a side.
//
// n points on a side of length h miss the mean of x^2n by m_n (h / 2)^2n, m_n = 4^n n!^4 / ((2n)!^2
// (2n + 1)) the mean square of the monic Legendre polynomial. A lobe (rho^2 + x^2)^-2, rho the
// distance to its nearest complex pole, has Taylor coefficients of at most C(2n + 3, 3) rho^-2n of
// itself, so that two sides err by 2 C(2n + 3, 3) m_n (h / 2 rho)^2n: 0.39 (h / rho)^4 at n = 2,
// 0.060 (h / rho)^6 at 3, 0.0075 (h / rho)^8 at 4 and 8.2e-5 (h / rho)^12 at 6.
struct PatchRule {
  int points;
  double shares;
};
inline constexpr std::array<PatchRule, 4> kPatchRules = {{{2, 45}, {3, 9.5}, {4, 4.2}, {6, 1.8}}};

}  // namespace lightkiln
