#include "core/bake/texel_harmonics.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/direction_map.h"
#include "core/sphere/harmonics.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

CubePlace cube_place(uint32_t texel, int size) {
  const auto n = static_cast<uint32_t>(size);
  return {static_cast<int>(texel / (n * n)), static_cast<int>(texel % n),
          static_cast<int>(texel / n % n)};
}

// The distance to the face is 1 / cosine, so cosine / distance^2 = cosine^3, where the cosine is
// the largest component.
double face_jacobian(const Vec3d& direction) {
  const double cosine =
      std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
  return cosine * cosine * cosine;
}

// (1 + a^2 + b^2)^(-3/2) for face coordinates a, b: the squared distance to the plane point and its
// cosine.
CubePoint cube_point(const CubePlace& place, int size, double within_x, double within_y) {
  const double s = (place.x + within_x) / size;
  const double t = (place.y + within_y) / size;
  const double a = 2 * s - 1, b = 2 * t - 1;
  const double distance2 = 1 + a * a + b * b;
  return {cube_direction(place.face, s, t), 1 / (distance2 * std::sqrt(distance2))};
}

namespace {

// The integral of every basis function over a texel, by Gauss-Legendre of 3 x 3 points on enough
// parts, scaled so that the first is exactly the texel's solid angle times y_00.
void integrate_basis(const CubePlace& place, int size, int bands, double solid_angle,
                     std::span<double> integral) {
  static constexpr double kNode = 0.7745966692414834;  // sqrt(3/5)
  static constexpr double kNodes[3] = {-kNode, 0, kNode};
  static constexpr double kWeights[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
  const int parts = std::max(1, 16 / size);
  std::vector<double> basis(integral.size());
  std::fill(integral.begin(), integral.end(), 0.0);
  double whole = 0;
  for (int i = 0; i < 3 * parts; ++i) {
    for (int j = 0; j < 3 * parts; ++j) {
      const auto at = [&](int k) { return (k / 3 + 0.5 + 0.5 * kNodes[k % 3]) / parts; };
      const CubePoint point = cube_point(place, size, at(i), at(j));
      const double weight = kWeights[i % 3] * kWeights[j % 3] * point.jacobian;
      sh_evaluate_basis(point.direction, bands, basis);
      for (size_t c = 0; c < basis.size(); ++c) integral[c] += weight * basis[c];
      whole += weight;
    }
  }
  for (double& value : integral) value *= solid_angle / whole;
}

}  // namespace

TexelHarmonics::TexelHarmonics(const CubePlace& place, int size, int bands)
    : bands_(bands), solid_angle_(cube_texel_solid_angle(place.x, place.y, size)) {
  const size_t count = sh_coefficient_count(bands);
  integral_.resize(count);
  basis_.resize(count);
  basis_sum_.resize(count);
  radiance_sum_.resize(count);
  if (bands > 0) integrate_basis(place, size, bands, solid_angle_, integral_);
}

void TexelHarmonics::begin() {
  std::fill(basis_sum_.begin(), basis_sum_.end(), 0.0);
  std::fill(radiance_sum_.begin(), radiance_sum_.end(), Vec3d{});
  jacobians_ = 0;
  radiance_ = {};
}

void TexelHarmonics::add(const CubePoint& point, const Vec3d& radiance) {
  if (bands_ == 0) return;
  sh_evaluate_basis(point.direction, bands_, basis_);
  const Vec3d weighted = radiance * point.jacobian;
  jacobians_ += point.jacobian;
  radiance_ += weighted;
  for (size_t c = 0; c < basis_.size(); ++c) {
    basis_sum_[c] += point.jacobian * basis_[c];
    radiance_sum_[c] += weighted * basis_[c];
  }
}

void TexelHarmonics::end(std::span<Vec3d> coefficients) const {
  if (bands_ == 0) return;
  const double scale = solid_angle_ / jacobians_;
  const Vec3d mean = radiance_ / jacobians_;
  for (size_t c = 0; c < basis_.size(); ++c) {
    coefficients[c] += radiance_sum_[c] * scale + mean * (integral_[c] - basis_sum_[c] * scale);
  }
}

}  // namespace lightkiln
