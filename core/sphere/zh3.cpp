#include "core/sphere/zh3.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

namespace {

// A zonal function of band 2 about axis a has the coefficients k sqrt(4 pi / 5) y_2m(a): the
// addition theorem for k y_20(a . d).
std::array<double, 5> zonal_band(const Vec3d& axis) {
  std::array<double, 9> basis;
  sh_evaluate_basis(axis, 3, basis);
  std::array<double, 5> band;
  for (size_t i = 0; i < 5; ++i) band[i] = std::sqrt(4 * kPi / 5) * basis[4 + i];
  return band;
}

// Curve fit of section 3.4.3: k = L00 r (0.08 + 0.6 r), r the linear band along the axis over L00.
Vec3d hallucinate(const std::array<Vec3d, 4>& linear, const Vec3d& axis) {
  Vec3d result;
  for (int c = 0; c < 3; ++c) {
    if (!(linear[0][c] > 0)) continue;
    const double along = linear[3][c] * axis.x + linear[1][c] * axis.y + linear[2][c] * axis.z;
    const double ratio = std::abs(along) / linear[0][c];
    result[c] = linear[0][c] * ratio * (0.08 + 0.6 * ratio);
  }
  return result;
}

}  // namespace

// The third band's irradiance error is A_2 times the length of the difference of coefficients, and
// its rms over the sphere that over sqrt(4 pi); the mean irradiance is A_0 L00 / sqrt(4 pi).
Zh3 make_zh3(const ShRgb& radiance) {
  ShRgb three(3);
  std::copy_n(radiance.coefficients.begin(),
              std::min(radiance.coefficients.size(), three.coefficients.size()),
              three.coefficients.begin());
  Zh3 result;
  std::copy_n(three.coefficients.begin(), 4, result.linear.begin());
  const Vec3d direction{luminance(result.linear[3]), luminance(result.linear[1]),
                        luminance(result.linear[2])};
  if (length(direction) > 0) result.axis = normalize(direction);
  const std::array<double, 5> zonal = zonal_band(result.axis);
  for (size_t i = 0; i < 5; ++i) result.fitted += three.coefficients[4 + i] * zonal[i];
  result.hallucinated = hallucinate(result.linear, result.axis);
  const auto error = [&](const Vec3d& k) {
    double worst = 0;
    for (int c = 0; c < 3; ++c) {
      if (!(result.linear[0][c] > 0)) continue;
      double sum = 0;
      for (size_t i = 0; i < 5; ++i) {
        const double difference = three.coefficients[4 + i][c] - k[c] * zonal[i];
        sum += difference * difference;
      }
      worst = std::max(worst, clamped_cosine_band(2) * std::sqrt(sum) /
                                  (clamped_cosine_band(0) * result.linear[0][c]));
    }
    return worst;
  };
  result.linear_error = error({});
  result.hallucinated_error = error(result.hallucinated);
  result.fitted_error = error(result.fitted);
  return result;
}

Vec3d zh3_irradiance(const Zh3& zh3, const Vec3d& zonal, const Vec3d& normal) {
  ShRgb linear(2);
  std::copy(zh3.linear.begin(), zh3.linear.end(), linear.coefficients.begin());
  const double c = dot(zh3.axis, normal);
  const double y20 = std::sqrt(5 / (16 * kPi)) * (3 * c * c - 1);
  return sh_irradiance(linear, normal) + zonal * (clamped_cosine_band(2) * y20);
}

}  // namespace lightkiln
