#pragma once

// Real spherical harmonics: orthonormal, no Condon-Shortley phase, index l*l + l + m, polar axis +Z
// of the world frame. y_{1,-1} is proportional to +y, y_{1,0} to +z, y_{1,1} to +x.

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

constexpr size_t sh_coefficient_count(int bands) {
  return static_cast<size_t>(bands) * static_cast<size_t>(bands);
}
constexpr size_t sh_index(int l, int m) {
  return static_cast<size_t>(l * l + l + m);
}

// RGB radiance coefficients of `bands` bands, [sh_index(l, m)].
struct ShRgb {
  int bands = 0;
  std::vector<Vec3d> coefficients;

  ShRgb() = default;
  explicit ShRgb(int bands_) : bands(bands_), coefficients(sh_coefficient_count(bands_)) {}
};

// Values of all basis functions of `bands` bands at a unit direction; `values` holds bands*bands.
// Fully normalised recurrence: finite and accurate to 1e-12 for at least 200 bands, poles included.
void sh_evaluate_basis(const Vec3d& direction, int bands, std::span<double> values);

// sum of c_i y_i(direction).
Vec3d sh_evaluate(const ShRgb& sh, const Vec3d& direction);

// The clamped cosine's zonal factors A_l: pi, 2 pi/3, pi/4, 0, -pi/24, ... (Ramamoorthi & Hanrahan
// 2001).
double clamped_cosine_band(int l);

// Factors of a zonal kernel k on the bands: 2 pi int k(t) P_l(t) dt over [lowest_cosine, 1], where
// k is not zero, so that int L(w) k(w.n) dw = sum_lm factor_l L_lm y_lm(n). Exact to rounding for
// polynomial kernels up to degree 128; t -> max(t, 0) with lowest_cosine 0 gives the clamped
// cosine.
std::vector<double> zonal_bands(const std::function<double(double cosine)>& kernel, int bands,
                                double lowest_cosine = -1);

// Every band multiplied by its factor: the convolution with the zonal kernel of those factors.
ShRgb sh_convolve(const ShRgb& sh, std::span<const double> band_factors);

// Irradiance at a surface with unit normal n, from radiance coefficients.
Vec3d sh_irradiance(const ShRgb& radiance, const Vec3d& normal);

}  // namespace lightkiln
