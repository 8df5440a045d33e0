#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/probe_cube.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

constexpr double kFirst = 3.544907701811032;  // 2 sqrt(pi)

TEST(Probes, SunSmallerThanATexelIsSeen) {
  for (const int height : {64, 1024}) {
    const int row = height / 4 + 1, column = height / 3;
    const SunnySky lit = sunny_sky(height, column, row, 12);
    const SunnySky plain = sunny_sky(height, column, row, 0);
    for (const int size : {8, 32}) {
      ProbesOrder order;
      order.positions = {{0, 1, 0}};
      order.size = size;
      order.bands = 2;
      order.max_samples = size == 8 ? 1024 : 64;
      ProbesHandle bright = open_probes(black_floor(), lit.sky, order, 2);
      ProbesHandle dull = open_probes(black_floor(), plain.sky, order, 2);
      Progress progress;
      const BakedProbes baked = bake_probes(bright), without = bake_probes(dull);
      const ProbeResult& probe = baked.probes.at(0);
      const double first = luminance(probe.sh.coefficients[0]);
      std::vector<double> basis(4);
      sh_evaluate_basis(lit.direction, 2, basis);
      for (size_t c = 0; c < 4; ++c) {
        const double sun = luminance(probe.sh.coefficients[c]) -
                           luminance(without.probes.at(0).sh.coefficients[c]);
        const double bar = first * (probe.sh_error + without.probes.at(0).sh_error) + 1e-3;
        EXPECT_NEAR(sun, lit.energy * basis[c], bar) << height << " " << size << " " << c;
        EXPECT_LE(bar, 0.1 * lit.energy * basis[0]);
      }
      // The texel that holds it is the mean over its square: its cosine^3 and area turn the sun's
      // solid angle into a share of the square.
      const CubeTexels texels = all_texels(size);
      int face = 0;
      double u = 0, v = 0;
      cube_coordinates(lit.direction, &face, &u, &v);
      const int x = static_cast<int>(u * size), y = static_cast<int>(v * size);
      const double cosine = std::max(
          {std::abs(lit.direction.x), std::abs(lit.direction.y), std::abs(lit.direction.z)});
      const double area = 4.0 / (size * size) * cosine * cosine * cosine;
      double mean = 0;
      for (size_t i = 0; i < texels.texels.size(); ++i) {
        mean += texels.shares[i] * static_cast<double>(probe.radiance[3 * i + 1]);
      }
      const double scale = cube_texel_solid_angle(x, y, size) / area;
      EXPECT_NEAR(mean, 0.5 + scale * lit.energy / (4 * kPi), 0.02) << height << " " << size;
      EXPECT_NEAR(baked.plan.reference_luminance, 0.5 + lit.energy / (4 * kPi), 0.02)
          << height << " " << size;
    }
    // Control: points in texels alone miss it, and do not tell.
    const LitScene scene(black_floor(), lit.sky, bounces(0));
    LitScene blind(black_floor(), lit.sky, bounces(0));
    blind.prepare(bounces(0), [](EffectSelection& s) { s.environment_sampling = false; });
    const CubeTexels texels = all_texels(8);
    const Vec3 origin = to_float(blind.scene.normalisation.to_normalised({0, 1, 0}));
    Progress progress;
    CubeSampling seeing(*scene.radiance, texels, origin, 4, 2, 1);
    CubeSampling missing(*blind.radiance, texels, origin, 4, 2, 1);
    seeing.advance(progress, 0, 1);
    missing.advance(progress, 0, 1);
    const double expected = 0.5 + lit.energy / (4 * kPi);
    EXPECT_NEAR(seeing.mean_luminance(), expected, 0.1);
    if (height == 1024) {
      EXPECT_LT(missing.mean_luminance(), 0.6 * expected);
      EXPECT_LT(missing.error().bound(0.95), 0.1);
    }
  }
}

// A lamp of 2 cm that the probe itself sees, 1 m away in a black room, of the solid angle that its
// corners span: A / d^2 but for 1e-4.
TEST(Probes, LampSmallerThanATexelIsSeen) {
  SceneData data = room(0, 0);
  data.parts.push_back(
      {make_quad({-0.01f, 0.8f, -0.01f}, {0.02f, 0, 0}, {0, 0, 0.02f}), grey(0, 10000), {}});
  const double energy = 10000 * 0.0004;
  for (const int size : {1, 8, 64}) {
    ProbesOrder order;
    order.positions = {{0, -0.2, 0}};
    order.size = size;
    order.target = 0.2;
    if (size == 64) order.max_samples = 64;
    ProbesHandle state = open_probes(data, {}, order);
    const BakedProbes baked = bake_probes(state);
    const ProbeResult& probe = baked.probes.at(0);
    EXPECT_NEAR(luminance(probe.sh.coefficients[0]) / (energy / kFirst), 1, 0.01) << size;
    EXPECT_NEAR(baked.plan.reference_luminance / (energy / (4 * kPi)), 1, 0.01) << size;
    EXPECT_TRUE(size == 64 || probe.accuracy == AccuracyStatus::converged) << size;
  }
  // Control: met by chance alone, it is lost without a trace of doubt.
  LitScene blind(data, {}, bounces(0));
  blind.prepare(bounces(0), [](EffectSelection& s) { s.emissive_sampling = false; });
  const CubeTexels texels = all_texels(8);
  Progress progress;
  CubeSampling missing(*blind.radiance, texels, {0, -0.2f, 0}, 5, 0, 1);
  missing.advance(progress, 0, 1);
  EXPECT_EQ(missing.mean_luminance(), 0);
  EXPECT_EQ(missing.error().bound(0.95), 0);
}

// Nothing of an ordinary sky is so bright that it needs looking for: no ray is spent on it.
TEST(Probes, NothingIsLookedForWhereNothingIsSmallAndBright) {
  for (const bool constant : {true, false}) {
    ProbesHandle state =
        open_probes(black_floor(), constant ? constant_environment({1, 1, 1}) : gradient_sky(), {});
    ProbesOrder order;
    EXPECT_EQ(bake_probes(state).chunk.report.counters.shadow_rays, 0u);
  }
}

}  // namespace
}  // namespace lightkiln::test
