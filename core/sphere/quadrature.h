#pragma once

// Gauss-Legendre quadrature.

#include <vector>

namespace lightkiln {

struct GaussRule {
  std::vector<double> nodes;    // in (-1, 1), ascending
  std::vector<double> weights;  // sum to 2
};
// Exact for polynomials up to degree 2 count - 1; count >= 1.
GaussRule gauss_legendre(int count);

// The largest error of the rule on exp(i x t / 2), |t| <= 1, relative to the interval: what a
// panel over `phase` radians of the fastest oscillation costs.
double gauss_phase_error(int count, double phase_rad);

}  // namespace lightkiln
