#pragma once

// Exponentials and powers in plain arithmetic, so that loops over them become vector code that
// gives the same bits at any width.

#include <bit>
#include <cmath>
#include <cstdint>

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

// base^power for base > 0 and power > 0, to 1e-13 of itself times max(1, |power ln base|); 0 under
// 1e-300. With base = 2^k m, 2/3 <= m < 4/3 and s = (m - 1) / (m + 1) in [-1/5, 1/7], ln m = 2 (s +
// s^3/3 + s^5/5 + ...); with power ln base = n ln 2 + r, |r| <= ln(2) / 2, the exponential of r is
// its Taylor polynomial. 1.5 2^52 rounds to whole numbers and shows them in its last bits.
inline double positive_power(double base, double power) {
  constexpr double kLn2 = 0.693147180559945309417, kShift = 6755399441055744.0;
  const double safe = base > 1e-300 ? base : 1e-300;
  const uint64_t bits = std::bit_cast<uint64_t>(safe);
  const uint64_t two_thirds = 0x3fe5555555555555u, one = 0x3ff0000000000000u;
  const uint64_t exponent = (bits - two_thirds) & 0xfff0000000000000u;
  const double m = std::bit_cast<double>(bits - exponent);
  const double k =
      std::bit_cast<double>(std::bit_cast<uint64_t>(kShift) + ((exponent >> 52) ^ 0x800u)) -
      (kShift + 2048);
  const double s = (m - 1) / (m + 1), s2 = s * s;
  double sum = 1.0 / 19;
  sum = sum * s2 + 1.0 / 17;
  sum = sum * s2 + 1.0 / 15;
  sum = sum * s2 + 1.0 / 13;
  sum = sum * s2 + 1.0 / 11;
  sum = sum * s2 + 1.0 / 9;
  sum = sum * s2 + 1.0 / 7;
  sum = sum * s2 + 1.0 / 5;
  sum = sum * s2 + 1.0 / 3;
  sum = sum * s2 + 1;
  const double logarithm = k * kLn2 + 2 * s * sum;
  const double wanted = power * logarithm, z = wanted > -690 ? wanted : -690;
  const double shifted = z * (1 / kLn2) + kShift, n = shifted - kShift, r = z - n * kLn2;
  double p = 1.0 / 6227020800;
  p = 1.0 / 479001600 + p * r;
  p = 1.0 / 39916800 + p * r;
  p = 1.0 / 3628800 + p * r;
  p = 1.0 / 362880 + p * r;
  p = 1.0 / 40320 + p * r;
  p = 1.0 / 5040 + p * r;
  p = 1.0 / 720 + p * r;
  p = 1.0 / 120 + p * r;
  p = 1.0 / 24 + p * r;
  p = 1.0 / 6 + p * r;
  p = 1.0 / 2 + p * r;
  p = 1 + p * r;
  p = 1 + p * r;
  const uint64_t whole = std::bit_cast<uint64_t>(shifted) << 52;
  const double result = p * std::bit_cast<double>(whole + one);
  return wanted > -690 ? result : 0;
}

}  // namespace lightkiln
