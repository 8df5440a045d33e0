#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/sphere/direction_map.h"
#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

constexpr double kFirst = 3.544907701811032;  // 2 sqrt(pi)

// L00 = 2 sqrt(pi) L, all else 0, at any size of the cube, and without noise.
TEST(Probes, ConstantLightGivesConstantCubesAndOneCoefficient) {
  for (const int size : {1, 2, 8}) {
    ProbesOrder order;
    order.size = size;
    order.bands = 5;
    order.max_bounces = 1;
    ProbesHandle state = open_probes(room(0.5f, 1), {}, order);
    const BakedProbes baked = bake_probes(state);
    const ProbeResult& probe = baked.probes.at(0);
    for (const float value : probe.radiance) EXPECT_NEAR(value, 1.5, 1e-5);
    EXPECT_LE(probe.error, 1e-5);
    EXPECT_EQ(probe.accuracy, AccuracyStatus::converged);
    EXPECT_EQ(probe.samples, baked.plan.min_samples);
    EXPECT_NEAR(probe.sh.coefficients[0].y, kFirst * 1.5, 1e-5);
    for (size_t c = 1; c < 25; ++c) EXPECT_NEAR(probe.sh.coefficients[c].y, 0, 1e-5) << c;
    EXPECT_NEAR(baked.plan.reference_luminance, 1.5, 1e-4);
  }
}

// Deep vertices are thinned by exact shares: texels stay exact, and what harmonics of higher bands
// see of it is noise that their error bar tells.
TEST(Probes, FurnaceStaysExactThroughThinnedBounces) {
  ProbesOrder order;
  order.max_bounces = 40;
  ProbesHandle state = open_probes(room(0.5f, 1), {}, order);
  const BakedProbes baked = bake_probes(state);
  const ProbeResult& probe = baked.probes.at(0);
  for (const float value : probe.radiance) EXPECT_NEAR(value, 2, 2e-5);
  EXPECT_LE(probe.error, 1e-5);
  EXPECT_NEAR(probe.sh.coefficients[0].y, kFirst * 2, kFirst * 2 * probe.sh_error);
  EXPECT_LE(probe.sh_error, 1e-3);
  for (size_t c = 1; c < 9; ++c) {
    EXPECT_NEAR(probe.sh.coefficients[c].y, 0, 2 * kFirst * 2 * probe.sh_error) << c;
  }
}

// A closed room saturates the bound on late bounces: L = 2 but for what they would have added. That
// loss is no noise, so it stands in bias_bound, and noise is left the rest of the order.
TEST(Probes, WhatBouncesLeaveOutIsPartOfTheOrder) {
  for (const double target : {0.5, 0.05}) {
    ProbesOrder order;
    order.size = 2;
    order.target = target;
    ProbesHandle state = open_probes(room(0.5f, 1), {}, order);
    const BakedProbes baked = bake_probes(state);
    const double lost = 1 - std::pow(0.5, baked.plan.max_bounces + 1);
    EXPECT_GT(baked.plan.bias_bound, 0);
    EXPECT_LE(baked.plan.bias_bound, kBiasShare * target);
    EXPECT_EQ(noise_target(*state, baked.plan), target - baked.plan.bias_bound);
    const ProbeResult& probe = baked.probes.at(0);
    EXPECT_EQ(probe.accuracy, AccuracyStatus::converged);
    EXPECT_LE(probe.error + baked.plan.bias_bound, target);
    for (const float value : probe.radiance) {
      EXPECT_NEAR(value, 2 * lost, 1e-4);
      EXPECT_LE((2 - value) / baked.plan.reference_luminance, baked.plan.bias_bound * 1.001);
    }
  }
  // A white room keeps no such promise and says so.
  ProbesOrder order;
  order.size = 1;
  order.max_samples = 64;
  ProbesHandle state = open_probes(room(1, 1), {}, order);
  const BakedProbes baked = bake_probes(state);
  EXPECT_GT(baked.plan.bias_bound, 0.05);
  EXPECT_EQ(noise_target(*state, baked.plan), 0.05);
  EXPECT_FALSE(baked.plan.warnings.empty());
}

TEST(Probes, DarkSceneIsToldAndFinite) {
  ProbesHandle state = open_probes(room(0.5f, 0), {}, {});
  const BakedProbes baked = bake_probes(state);
  for (const float value : baked.probes[0].radiance) EXPECT_EQ(value, 0);
  ASSERT_FALSE(baked.plan.warnings.empty());
  EXPECT_NE(baked.plan.warnings.back().find("No light"), std::string::npos);
  EXPECT_EQ(baked.plan.reference_luminance, 1);
}

TEST(Probes, EmptySceneIsTheEnvironment) {
  ProbesOrder order;
  order.bands = 4;
  ProbesHandle state = open_probes({}, gradient_sky(), order);
  const BakedProbes baked = bake_probes(state);
  const ProbeResult& probe = baked.probes.at(0);
  EXPECT_EQ(probe.surroundings.status, ProbeStatus::valid);
  EXPECT_EQ(probe.surroundings.hit_share, 0);
  for (const float distance : probe.distance) EXPECT_EQ(distance, 0);
  // Texels by 8 x 8 points are the truth; y_1m of 1 + d/2 is sqrt(4 pi / 3) / 2 for one channel.
  std::vector<double> basis(16);
  std::vector<Vec3d> truth(16);
  const int n = 512;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < 2 * n; ++x) {
      const double v0 = kPi * y / n, v1 = kPi * (y + 1) / n;
      const double weight = (std::cos(v0) - std::cos(v1)) * kPi / n;
      const Vec3d d = latlong_direction((x + 0.5) / (2 * n), (y + 0.5) / n);
      sh_evaluate_basis(d, 4, basis);
      const Vec3d value = to_double(environment_radiance(*state->environment, to_float(d)));
      for (size_t c = 0; c < 16; ++c) truth[c] += value * (basis[c] * weight);
    }
  }
  for (size_t c = 0; c < 16; ++c) {
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_NEAR(probe.sh.coefficients[c][channel], truth[c][channel], 2e-5) << c;
    }
  }
  EXPECT_NEAR(probe.sh.coefficients[sh_index(1, 1)].x, 0.5 * std::sqrt(4 * kPi / 3), 2e-3);
}

// Sampled harmonics are not those of texels: they do not depend on the size of the cube.
TEST(Probes, HarmonicsAgreeForCubesOfAnySize) {
  ProbesOrder order;
  order.bands = 4;
  order.max_bounces = 2;
  order.target = 0.01;
  order.max_samples = 16384;
  std::vector<ProbeResult> results;
  for (const int size : {1, 8}) {
    order.size = size;
    ProbesHandle state = open_probes(colored_room(), {}, order, 2);
    results.push_back(bake_probes(state).probes.at(0));
  }
  const double first = luminance(results[0].sh.coefficients[0]);
  for (size_t c = 0; c < 16; ++c) {
    EXPECT_NEAR(luminance(results[0].sh.coefficients[c]), luminance(results[1].sh.coefficients[c]),
                2 * first * std::hypot(results[0].sh_error, results[1].sh_error))
        << c;
  }
  EXPECT_LE(results[0].sh_error, 0.02);
}

}  // namespace
}  // namespace lightkiln::test
