// Source: Ivanic & Ruedenberg, "Rotation Matrices for Real Spherical Harmonics. Direct
// Determination by Recursion", J. Phys. Chem. 100(15), 1996, with the corrections of 102(45), 1998.

#include "core/sphere/harmonic_rotation.h"

#include <cmath>
#include <cstdlib>
#include <vector>

namespace lightkiln {

namespace {

// The matrix of one band: entry (m, n) of a (2 l + 1)^2 array, m and n from -l to l.
struct BandMatrix {
  int l = 0;
  std::vector<double> entries;

  explicit BandMatrix(int l_)
      : l(l_), entries(static_cast<size_t>(2 * l_ + 1) * static_cast<size_t>(2 * l_ + 1)) {}
  double& at(int m, int n) { return entries[static_cast<size_t>((m + l) * (2 * l + 1) + n + l)]; }
  double at(int m, int n) const {
    return entries[static_cast<size_t>((m + l) * (2 * l + 1) + n + l)];
  }
};

// The P of the paper's table 2: an entry of band l from band 1 (row i) and band l - 1 (row a).
double product(const BandMatrix& one, const BandMatrix& before, int i, int a, int n, int l) {
  if (n == -l) return one.at(i, 1) * before.at(a, -l + 1) + one.at(i, -1) * before.at(a, l - 1);
  if (n == l) return one.at(i, 1) * before.at(a, l - 1) - one.at(i, -1) * before.at(a, -l + 1);
  return one.at(i, 0) * before.at(a, n);
}

// R_mn = u U + v V + w W (equation 8.1, tables 1 and 2). Terms whose coefficient is zero are not
// formed: their operands lie outside band l - 1.
double entry(const BandMatrix& one, const BandMatrix& before, int m, int n, int l) {
  const int k = std::abs(m);
  const double denominator =
      std::abs(n) == l ? 2.0 * l * (2.0 * l - 1) : double(l + n) * double(l - n);
  double sum = 0;
  if (k < l) {
    const double u = std::sqrt(double(l + m) * double(l - m) / denominator);
    sum += u * product(one, before, 0, m, n, l);
  }
  const double v = std::sqrt(double(l + k - 1) * double(l + k) / denominator);
  if (m == 0) {
    sum -= std::sqrt(0.5) * v *
           (product(one, before, 1, 1, n, l) + product(one, before, -1, -1, n, l));
  } else {
    const int sign = m > 0 ? 1 : -1;
    const double edge = k == 1 ? std::sqrt(2.0) : 1.0;
    // m > 0: P(1, m-1) sqrt(1+d) - P(-1, 1-m) (1-d); m < 0: P(1, m+1) (1-d) + P(-1, -m-1) sqrt(1+d)
    double value = 0;
    if (sign > 0) {
      value = edge * product(one, before, 1, m - 1, n, l);
      if (k > 1) value -= product(one, before, -1, 1 - m, n, l);
    } else {
      value = edge * product(one, before, -1, -m - 1, n, l);
      if (k > 1) value += product(one, before, 1, m + 1, n, l);
    }
    sum += 0.5 * v * value;
    if (k < l - 1) {
      const double w = -0.5 * std::sqrt(double(l - k - 1) * double(l - k) / denominator);
      sum +=
          w * (sign > 0
                   ? product(one, before, 1, m + 1, n, l) + product(one, before, -1, -m - 1, n, l)
                   : product(one, before, 1, m - 1, n, l) - product(one, before, -1, 1 - m, n, l));
    }
  }
  return sum;
}

}  // namespace

ShRgb sh_rotate(const ShRgb& sh, const double rotation[3][3]) {
  ShRgb result = sh;
  if (sh.bands < 2) return result;
  // Band 1 in the order y, z, x is the rotation itself.
  constexpr int kAxis[3] = {1, 2, 0};
  BandMatrix one(1);
  for (int m = -1; m <= 1; ++m) {
    for (int n = -1; n <= 1; ++n) one.at(m, n) = rotation[kAxis[m + 1]][kAxis[n + 1]];
  }
  BandMatrix before(0);
  before.at(0, 0) = 1;
  for (int l = 1; l < sh.bands; ++l) {
    BandMatrix current(l);
    for (int m = -l; m <= l; ++m) {
      Vec3d sum;
      for (int n = -l; n <= l; ++n) {
        current.at(m, n) = l == 1 ? one.at(m, n) : entry(one, before, m, n, l);
        sum += sh.coefficients[sh_index(l, n)] * current.at(m, n);
      }
      result.coefficients[sh_index(l, m)] = sum;
    }
    before = std::move(current);
  }
  return result;
}

}  // namespace lightkiln
