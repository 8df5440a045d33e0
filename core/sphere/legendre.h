#pragma once

// Normalised associated Legendre functions on many rings at once: the inner loops of the harmonic
// transform. P_lm includes the factor sqrt2 of orders m > 0, so that P_lm cos(m phi) is a basis
// function.

#include <vector>

#include "core/sphere/fourier.h"

namespace lightkiln {

// P_lm = z grow[l-m] P_{l-1,m} - keep[l-m] P_{l-2,m} for l > m (see harmonics.cpp).
struct LegendreStep {
  std::vector<double> grow, keep;
  LegendreStep(int m, int bands);
};

// P_mm at colatitude theta, m = 0.. : start(m, sin theta).
class LegendreStart {
 public:
  explicit LegendreStart(int bands);
  double operator()(int m, double sine) const;

 private:
  std::vector<double> scale_;
};

// True when |P_lm| < 1e-14 for every l < bands at polar distances up to `theta` (from the nearer
// pole): below its turning point P_lm follows the Bessel function J_m(l theta), and with
// m / (l theta) = cosh a that is at most exp(m (tanh a - a)).
bool legendre_negligible(int m, double theta, int bands);

}  // namespace lightkiln
