// Directions behind the surface and grazing views, where reflection is easily counted wrong.

#include <cmath>

#include <gtest/gtest.h>

#include "core/environment/dfg.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

// White reflectance as a mean over the visible normals of Heitz 2018, drawn on a grid: the share
// G2 / G1 of each whose reflection stays above the surface, or of all of them.
double white_by_visible_normals(double alpha, double cosine, bool count_those_behind) {
  constexpr int kSteps = 1000;
  const double a2 = alpha * alpha;
  const Vec3d v{std::sqrt(1 - cosine * cosine), 0, cosine};
  const Vec3d w = normalize(Vec3d{alpha * v.x, 0, v.z});  // the view, stretched
  const Vec3d across{-w.z, 0, w.x};
  const auto smith = [&](double z) { return 0.5 * (std::sqrt(1 + a2 * (1 / (z * z) - 1)) - 1); };
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double r = std::sqrt((i + 0.5) / kSteps), phi = 2 * kPi * (j + 0.5) / kSteps;
      const double x = r * std::cos(phi), edge = std::sqrt(1 - x * x);
      const double tilt = 0.5 * (1 + w.z);
      const double y = (1 - tilt) * edge + tilt * r * std::sin(phi);
      const double z = std::sqrt(std::max(0.0, 1 - x * x - y * y));
      const Vec3d d = Vec3d{0, x, 0} + across * y + w * z;
      const Vec3d h = normalize(Vec3d{alpha * d.x, alpha * d.y, std::max(d.z, 1e-12)});
      const double l_z = 2 * dot(v, h) * h.z - v.z;
      if (l_z <= 0 && !count_those_behind) continue;
      sum += (1 + smith(cosine)) / (1 + smith(cosine) + smith(std::abs(l_z)));
    }
  }
  return sum / (double(kSteps) * kSteps);
}

// X2
TEST(HalfSpace, LightBehindTheSurfaceIsNotReflected) {
  for (const double alpha : {0.25, 1.0}) {
    for (const double cosine : {0.1, 0.5}) {
      const DfgValue value = ggx_dfg(alpha, cosine);
      const double white = value.scale + value.bias;
      EXPECT_NEAR(white, white_by_visible_normals(alpha, cosine, false), 1e-3)
          << alpha << " " << cosine;
    }
    // Positive control: counted, such light brings more than any error above.
    const double wrong = white_by_visible_normals(alpha, 0.1, true);
    const DfgValue value = ggx_dfg(alpha, 0.1);
    EXPECT_GT(wrong - (value.scale + value.bias), 0.01) << alpha;
  }
}

// X2
TEST(HalfSpace, GrazingViewsStayFiniteAndLoseEnergyOnly) {
  for (const double alpha : {1e-8, 1e-3, 0.002025, 0.1, 1.0}) {
    for (const double cosine : {1e-4, 1e-2, 0.3, 1.0}) {
      const DfgValue value = ggx_dfg(alpha, cosine);
      EXPECT_TRUE(std::isfinite(value.scale) && value.scale >= 0) << alpha << " " << cosine;
      EXPECT_TRUE(std::isfinite(value.bias) && value.bias >= 0) << alpha << " " << cosine;
      EXPECT_LE(value.scale + value.bias, 1 + 1e-5) << alpha << " " << cosine;
    }
  }
}

}  // namespace
}  // namespace lightkiln
