#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/probe_cube.h"
#include "core/base/random.h"
#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

// A lamp of 2 cm in a room of 2 m, met by chance alone, is the heavy tail that an estimate of
// variance cannot see; with shadow rays that look for it there is none.
TEST(Probes, HeavyTailsAreSuspicious) {
  SceneData data = room(0.5f, 0);
  data.parts.push_back(
      {make_quad({-0.01f, 0.9f, -0.01f}, {0.02f, 0, 0}, {0, 0, 0.02f}), grey(0, 1000), {}});
  LitScene lit(data, {}, bounces(1));
  const CubeTexels texels = all_texels(4);
  Progress progress;
  for (const bool sampled : {true, false}) {
    lit.prepare(bounces(1), [&](EffectSelection& s) { s.emissive_sampling = sampled; });
    CubeSampling sampling(*lit.radiance, texels, {0, -0.2f, 0}, 5, 0, 1);
    while (sampling.samples() < 1024) sampling.advance(progress, 0, 1);
    EXPECT_EQ(sampling.suspicious(), !sampled);
  }
}

// Stopping on what the samples claim must not spoil the claim: after doublings, the cube's true
// error is within the order in 95 % of bakes, and bars of texels cover theirs 93 to 97 times in a
// hundred. The texels' means over all bakes serve as the truth.
TEST(Probes, StoppingKeepsTheErrorsCoverage) {
  constexpr size_t kBakes = 150;
  const LitScene lit(colored_room(), {}, bounces(1));
  const Vec3 origin = to_float(lit.scene.normalisation.to_normalised({0.4, 0.1, 0.5}));
  Progress progress;
  for (const int size : {1, 2}) {
    const CubeTexels texels = all_texels(size);
    CubeSampling first(*lit.radiance, texels, origin, 1, 0, 2);
    first.advance(progress, 0, 1);
    // Less than the fewest samples bring, so that there is something to stop.
    const double target = 0.7 * first.error().bound(kLookConfidence);
    std::vector<std::vector<double>> values, bars;
    std::vector<double> truth(texels.texels.size());
    size_t doubled = 0;
    for (size_t run = 0; run < kBakes; ++run) {
      CubeSampling sampling(*lit.radiance, texels, origin, hash_combine(7, run), 0, 2);
      do {
        sampling.advance(progress, 0, 1);
      } while (sampling.error().bound(kLookConfidence) > target);
      doubled += sampling.samples() > 64;
      values.emplace_back();
      bars.emplace_back();
      for (size_t i = 0; i < truth.size(); ++i) {
        values.back().push_back(luminance(to_double(sampling.texel(i))));
        bars.back().push_back(sampling.half_width(i));
        truth[i] += values.back().back() / kBakes;
      }
    }
    size_t kept = 0, covered = 0;
    for (size_t run = 0; run < kBakes; ++run) {
      double sum = 0;
      for (size_t i = 0; i < truth.size(); ++i) {
        const double off = values[run][i] - truth[i];
        sum += texels.shares[i] * off * off;
        covered += std::abs(off) <= bars[run][i];
      }
      kept += std::sqrt(sum) <= target;
    }
    EXPECT_GE(static_cast<double>(kept) / kBakes, 0.95) << size;
    const double share = static_cast<double>(covered) / static_cast<double>(kBakes * truth.size());
    EXPECT_GE(share, 0.93) << size;
    EXPECT_LE(share, 0.97) << size;
    EXPECT_GE(doubled, kBakes / 2) << size;  // otherwise nothing was stopped
  }
}

// 95 % half-widths of texels against a truth of 64 times the samples.
TEST(Probes, ErrorBarsCoverTheTruth) {
  const LitScene lit(colored_room(), {}, bounces(3));
  const CubeTexels texels = all_texels(6);
  const Vec3 origin = to_float(lit.scene.normalisation.to_normalised({0.4, 0.1, 0.5}));
  Progress progress;
  CubeSampling truth(*lit.radiance, texels, origin, hash_combine(99, 0), 0, 2);
  while (truth.samples() < 4096) truth.advance(progress, 0, 1);
  int covered = 0, bars = 0;
  double claimed = 0, actual = 0;
  for (uint64_t seed = 1; seed <= 16; ++seed) {
    CubeSampling sampling(*lit.radiance, texels, origin, hash_combine(seed, 1), 0, 2);
    sampling.advance(progress, 0, 1);
    for (size_t i = 0; i < texels.texels.size(); ++i) {
      const double half = sampling.half_width(i);
      if (!(half > 1e-6)) continue;
      const double difference =
          luminance(to_double(sampling.texel(i))) - luminance(to_double(truth.texel(i)));
      ++bars;
      // The truth's own noise widens the bar as independent noise does.
      if (std::abs(difference) <= std::hypot(half, truth.half_width(i))) ++covered;
      claimed += half * half;
      actual += difference * difference;
    }
  }
  const double share = static_cast<double>(covered) / bars;
  EXPECT_GE(share, 0.93) << bars;
  EXPECT_LE(share, 0.97) << bars;
  // The mean square of a half-width is t^2 = 2.13^2 times the variance.
  EXPECT_NEAR(std::sqrt(claimed / actual), 2.13, 0.2);
}

}  // namespace
}  // namespace lightkiln::test
