// Sources: the fully normalised recurrence of associated Legendre functions (Holmes & Featherstone,
// "A unified approach to the Clenshaw summation", J. Geodesy 76, 2002, equations 11-13), which
// never forms a factorial; Ramamoorthi & Hanrahan, "An Efficient Representation for Irradiance
// Environment Maps", SIGGRAPH 2001.

#include "core/sphere/harmonics.h"

#include <cassert>
#include <cmath>

#include "core/sphere/quadrature.h"

namespace lightkiln {

// With normalised Legendre functions P, the basis is
//   y_{l,0} = P_l0(z),  y_{l,m} = sqrt2 P_lm(z) cos(m phi),  y_{l,-m} = sqrt2 P_lm(z) sin(m phi).
// The factor sin^m(theta) of P_lm is taken out and multiplied into cos and sin, where it makes the
// real and imaginary part of (x + i y)^m: a polynomial, so poles need no angle. What remains obeys
//   Q_mm     = sqrt((2m+1) / (2m)) Q_{m-1,m-1},            Q_00 = sqrt(1 / (4 pi))
//   Q_{l,m}  = a (z Q_{l-1,m} - b Q_{l-2,m}),
//   a = sqrt((4 l^2 - 1) / (l^2 - m^2)),  b = sqrt(((l-1)^2 - m^2) / (4 (l-1)^2 - 1)).
void sh_evaluate_basis(const Vec3d& direction, int bands, std::span<double> values) {
  assert(bands >= 1 && values.size() >= sh_coefficient_count(bands));
  double sectoral = std::sqrt(1 / (4 * kPi));
  double power_re = 1, power_im = 0;  // (x + i y)^m
  for (int m = 0; m < bands; ++m) {
    if (m > 0) {
      sectoral *= std::sqrt((2.0 * m + 1) / (2.0 * m));
      const double re = power_re * direction.x - power_im * direction.y;
      power_im = power_re * direction.y + power_im * direction.x;
      power_re = re;
    }
    const double scale = m > 0 ? std::sqrt(2.0) : 1.0;
    // Q stays below e^l, which a double holds for l up to 700, and the powers below 1.
    double before = 0, value = sectoral;
    for (int l = m; l < bands; ++l) {
      if (l > m) {
        const double l2 = double(l) * l, m2 = double(m) * m, k2 = double(l - 1) * (l - 1);
        const double a = std::sqrt((4 * l2 - 1) / (l2 - m2));
        const double b = std::sqrt((k2 - m2) / (4 * k2 - 1));
        const double next = a * (direction.z * value - (l > m + 1 ? b * before : 0));
        before = value;
        value = next;
      }
      values[sh_index(l, m)] = scale * value * power_re;
      if (m > 0) values[sh_index(l, -m)] = scale * value * power_im;
    }
  }
}

Vec3d sh_evaluate(const ShRgb& sh, const Vec3d& direction) {
  std::vector<double> basis(sh.coefficients.size());
  sh_evaluate_basis(direction, sh.bands, basis);
  Vec3d sum;
  for (size_t i = 0; i < basis.size(); ++i) sum += sh.coefficients[i] * basis[i];
  return sum;
}

// A_l = 2 pi (-1)^{l/2-1} / ((l+2)(l-1)) l! / (2^l (l/2)!^2) for even l; the last factor is the
// central binomial over 2^l, built as prod (2k-1)/(2k) so that no factorial overflows.
double clamped_cosine_band(int l) {
  if (l == 1) return 2 * kPi / 3;
  if (l % 2 == 1) return 0;
  double central = 1;
  for (int k = 1; k <= l / 2; ++k) central *= (2.0 * k - 1) / (2.0 * k);
  const double sign = (l / 2) % 2 == 1 ? 1 : -1;
  return 2 * kPi * sign / ((l + 2.0) * (l - 1.0)) * central;
}

// The Funk-Hecke theorem: a zonal kernel multiplies band l by 2 pi int k P_l.
std::vector<double> zonal_bands(const std::function<double(double cosine)>& kernel, int bands,
                                double lowest_cosine) {
  assert(bands >= 1 && lowest_cosine < 1);
  const GaussRule rule = gauss_legendre(bands / 2 + 65);
  const double half = 0.5 * (1 - lowest_cosine), middle = 0.5 * (1 + lowest_cosine);
  std::vector<double> factors(static_cast<size_t>(bands));
  for (size_t i = 0; i < rule.nodes.size(); ++i) {
    const double t = middle + half * rule.nodes[i];
    const double weight = 2 * kPi * half * rule.weights[i] * kernel(t);
    double before = 0, value = 1;
    for (int l = 0; l < bands; ++l) {
      factors[static_cast<size_t>(l)] += weight * value;
      const double next = ((2 * l + 1) * t * value - l * before) / (l + 1);
      before = value;
      value = next;
    }
  }
  return factors;
}

ShRgb sh_convolve(const ShRgb& sh, std::span<const double> band_factors) {
  assert(band_factors.size() >= static_cast<size_t>(sh.bands));
  ShRgb result = sh;
  for (int l = 0; l < sh.bands; ++l) {
    for (int m = -l; m <= l; ++m) {
      result.coefficients[sh_index(l, m)] *= band_factors[static_cast<size_t>(l)];
    }
  }
  return result;
}

Vec3d sh_irradiance(const ShRgb& radiance, const Vec3d& normal) {
  std::vector<double> basis(radiance.coefficients.size());
  sh_evaluate_basis(normal, radiance.bands, basis);
  Vec3d sum;
  for (int l = 0; l < radiance.bands; ++l) {
    const double band = clamped_cosine_band(l);
    for (int m = -l; m <= l; ++m) {
      sum += radiance.coefficients[sh_index(l, m)] * (band * basis[sh_index(l, m)]);
    }
  }
  return sum;
}

}  // namespace lightkiln
