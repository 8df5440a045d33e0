#pragma once

// Exponentials and powers in plain arithmetic, so that loops over them become vector code that
// gives the same bits at any width.

#include <cmath>

namespace lightkiln {

// exp(-z) for z >= 0, next to 0 beyond 64: a Taylor polynomial of z / 64, squared six times;
// relative error under 1e-9 up to z = 24 and 5e-6 beyond.
inline double exp_minus(double z) {
  const double x = (z < 64 ? z : 64) * (1.0 / 64);
  double p = 1.0 / 3628800;
  p = 1.0 / 362880 - p * x;
  p = 1.0 / 40320 - p * x;
  p = 1.0 / 5040 - p * x;
  p = 1.0 / 720 - p * x;
  p = 1.0 / 120 - p * x;
  p = 1.0 / 24 - p * x;
  p = 1.0 / 6 - p * x;
  p = 1.0 / 2 - p * x;
  p = 1 - p * x;
  p = 1 - p * x;
  for (int i = 0; i < 6; ++i) p *= p;
  return p;
}

// base^power for base in [0, 1] and power >= 0.5, to 1e-8 of 1. With y = base^(1/16) and s = (1 -
// y) / (1 + y), -ln base = 32 (s + s^3/3 + s^5/5 + ...). The base counts as 1e-12 at least.
inline double power_below_one(double base, double power) {
  const double safe = base > 1e-12 ? base : 1e-12;
  const double y = std::sqrt(std::sqrt(std::sqrt(std::sqrt(safe))));
  const double s = (1 - y) / (1 + y), s2 = s * s;
  double sum = 1.0 / 17;
  sum = sum * s2 + 1.0 / 15;
  sum = sum * s2 + 1.0 / 13;
  sum = sum * s2 + 1.0 / 11;
  sum = sum * s2 + 1.0 / 9;
  sum = sum * s2 + 1.0 / 7;
  sum = sum * s2 + 1.0 / 5;
  sum = sum * s2 + 1.0 / 3;
  sum = sum * s2 + 1;
  return exp_minus(power * 32 * s * sum);
}

}  // namespace lightkiln
