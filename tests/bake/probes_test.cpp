#include <algorithm>
#include <cmath>
#include <functional>
#include <thread>

#include <gtest/gtest.h>

#include "core/bake/probe_cube.h"
#include "core/bake/probes_state.h"
#include "core/base/random.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

struct Order {
  std::vector<Vec3d> positions = {{0, 0, 0}};
  int size = 8;
  int bands = 3;
  std::optional<int> max_bounces;
  double target = 0.05;
  std::optional<uint64_t> max_samples;
  std::optional<double> max_seconds;
};

using State = std::unique_ptr<ProbesState, ProbesStateDeleter>;

State open(const SceneData& data, std::optional<Environment> environment, const Order& order,
           int threads = 1) {
  State state(new ProbesState);
  ProbesParameters parameters;
  parameters.positions = order.positions;
  parameters.cubemap.size = order.size;
  parameters.sh.bands = order.bands;
  parameters.max_bounces = order.max_bounces;
  state->spec.parameters = parameters;
  state->spec.accuracy.target_error = order.target;
  state->spec.accuracy.max_samples = order.max_samples;
  state->spec.accuracy.max_seconds = order.max_seconds;
  state->grants.threads = threads;
  state->scene = make_scene(data);
  state->environment = std::move(environment);
  state->survey = survey_light(state->scene, state->light());
  TracerOptions options;
  options.alpha_test = state->survey.alpha_tested;
  state->tracer = std::make_unique<Tracer>(state->scene, options);
  return state;
}

std::vector<ProbeResult> read_all(const ProbesState& state, const ChunkResult& chunk) {
  ByteReader reader(chunk.bytes);
  std::vector<ProbeResult> results;
  while (!reader.at_end()) {
    results.push_back(read_probe(reader, state.parameters(), results.size()));
  }
  return results;
}

struct Baked {
  Plan plan;
  ChunkResult chunk;
  std::vector<ProbeResult> probes;
};
Baked bake(State& state) {
  Progress progress;
  Baked baked;
  baked.plan = probes_plan(*state, progress);
  baked.chunk = probes_chunk(*state, baked.plan, {0, baked.plan.elements}, progress);
  baked.probes = read_all(*state, baked.chunk);
  return baked;
}

SceneData room(float albedo, float emission) {
  SceneData data;
  data.parts.push_back({reversed(make_box({-1, -1, -1}, {1, 1, 1})), grey(albedo, emission), {}});
  return data;
}

// Three colours of walls, a lamp under the ceiling, a block.
SceneData colored_room() {
  SceneData data;
  const MeshData box = reversed(make_box({-1, -1, -1}, {1, 1, 1}));
  const Material walls[] = {diffuse({0.7f, 0.1f, 0.1f}), diffuse({0.1f, 0.7f, 0.1f}), grey(0.6f)};
  for (size_t face = 0; face < 6; ++face) {
    MeshData wall = box;
    wall.triangles = {box.triangles[2 * face], box.triangles[2 * face + 1]};
    data.parts.push_back({wall, walls[std::min<size_t>(face, 2)], {}});
  }
  data.parts.push_back(
      {make_quad({-0.4f, 0.95f, -0.4f}, {0.8f, 0, 0}, {0, 0, 0.8f}), grey(0.3f, 8), {}});
  data.parts.push_back({make_box({-0.6f, -1, -0.5f}, {-0.1f, -0.2f, 0.1f}), grey(0.5f), {}});
  return data;
}

Environment gradient_sky() {
  Environment sky = constant_environment({1, 1, 1});
  sky.constant = false;
  sky.radiance = Image(64, 32, 3);
  Vec3d sum;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / 64, (y + 0.5) / 32);
      const Vec3 value = to_float(Vec3d{1 + 0.5 * d.x, 1 + 0.5 * d.y, 1 + 0.5 * d.z});
      std::copy_n(&value.x, 3, sky.radiance.at(x, y));
      sky.max_luminance = std::max(sky.max_luminance, luminance(to_double(value)));
    }
  }
  sky.mean = {1, 1, 1};
  return sky;
}

constexpr double kFirst = 3.544907701811032;  // 2 sqrt(pi)

// L00 = 2 sqrt(pi) L, all else 0, at any size of the cube, and without noise.
TEST(Probes, ConstantLightGivesConstantCubesAndOneCoefficient) {
  for (const int size : {1, 2, 8}) {
    Order order;
    order.size = size;
    order.bands = 5;
    order.max_bounces = 1;
    State state = open(room(0.5f, 1), {}, order);
    const Baked baked = bake(state);
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
  Order order;
  order.max_bounces = 40;
  State state = open(room(0.5f, 1), {}, order);
  const Baked baked = bake(state);
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
    Order order;
    order.size = 2;
    order.target = target;
    State state = open(room(0.5f, 1), {}, order);
    const Baked baked = bake(state);
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
  Order order;
  order.size = 1;
  order.max_samples = 64;
  State state = open(room(1, 1), {}, order);
  const Baked baked = bake(state);
  EXPECT_GT(baked.plan.bias_bound, 0.05);
  EXPECT_EQ(noise_target(*state, baked.plan), 0.05);
  EXPECT_FALSE(baked.plan.warnings.empty());
}

TEST(Probes, TornChunksAreRefused) {
  Order order;
  order.size = 2;
  order.max_bounces = 0;
  order.positions = {{0, 0, 0}, {0.1, 0, 0}};
  State state = open(room(0.5f, 1), {}, order);
  Progress progress;
  Plan plan = probes_plan(*state, progress);
  plan.chunks = {{0, 2}};
  const ChunkResult whole = probes_chunk(*state, plan, {0, 2}, progress);
  EXPECT_NO_THROW(probes_assemble(*state, plan, std::span(&whole, 1), progress));
  const auto refused = [&](const std::function<void(std::vector<std::byte>&)>& tear) {
    ChunkResult torn = whole;
    tear(torn.bytes);
    try {
      probes_assemble(*state, plan, std::span(&torn, 1), progress);
      return false;
    } catch (const Error& error) {
      return error.code() == ErrorCode::internal;
    }
  };
  EXPECT_TRUE(refused([](auto& bytes) { bytes.pop_back(); }));
  EXPECT_TRUE(refused([](auto& bytes) { bytes.push_back(std::byte{0}); }));
  EXPECT_TRUE(refused([](auto& bytes) { bytes.clear(); }));
  EXPECT_TRUE(refused([](auto& bytes) { bytes[0] = std::byte{1}; }));      // index
  EXPECT_TRUE(refused([](auto& bytes) { bytes[8] = std::byte{9}; }));      // status
  EXPECT_TRUE(refused([](auto& bytes) { bytes[19] = std::byte{0xff}; }));  // a share
  EXPECT_TRUE(refused([](auto& bytes) { std::fill_n(bytes.end() - 4, 4, std::byte{0xff}); }));
  // Torn in the middle and joined again.
  EXPECT_TRUE(refused([](auto& bytes) { bytes.erase(bytes.begin() + 100, bytes.begin() + 108); }));
  const ChunkResult second = probes_chunk(*state, plan, {1, 1}, progress);
  EXPECT_TRUE(refused([&](auto& bytes) { bytes = second.bytes; }));
}

TEST(Probes, EmptySceneIsTheEnvironment) {
  Order order;
  order.bands = 4;
  State state = open({}, gradient_sky(), order);
  const Baked baked = bake(state);
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
  Order order;
  order.bands = 4;
  order.max_bounces = 2;
  order.target = 0.01;
  order.max_samples = 16384;
  std::vector<ProbeResult> results;
  for (const int size : {1, 8}) {
    order.size = size;
    State state = open(colored_room(), {}, order, 2);
    results.push_back(bake(state).probes.at(0));
  }
  const double first = luminance(results[0].sh.coefficients[0]);
  for (size_t c = 0; c < 16; ++c) {
    EXPECT_NEAR(luminance(results[0].sh.coefficients[c]), luminance(results[1].sh.coefficients[c]),
                2 * first * std::hypot(results[0].sh_error, results[1].sh_error))
        << c;
  }
  EXPECT_LE(results[0].sh_error, 0.02);
}

TEST(Probes, InsideASolidIsTold) {
  SceneData data;
  data.parts.push_back({make_box({-1, -1, -1}, {1, 1, 1}), grey(0.5f), {}});
  Order order;
  order.positions = {{0.2, 0.1, 0}, {3, 0.5, 0}};
  State state = open(data, constant_environment({1, 1, 1}), order);
  const Baked baked = bake(state);
  EXPECT_EQ(baked.probes[0].surroundings.status, ProbeStatus::inside_geometry);
  EXPECT_EQ(baked.probes[0].surroundings.backface_share, 1.0);
  EXPECT_EQ(baked.probes[0].surroundings.hit_share, 1.0);
  EXPECT_EQ(baked.probes[1].surroundings.status, ProbeStatus::valid);
  EXPECT_EQ(baked.probes[1].surroundings.backface_share, 0.0);
  // A room seen from inside is no solid, nor is a double-sided box.
  data.parts[0].material.double_sided = true;
  state = open(data, constant_environment({1, 1, 1}), order);
  EXPECT_EQ(bake(state).probes[0].surroundings.status, ProbeStatus::valid);
}

TEST(Probes, OnAFaceEdgeOrCornerIsTold) {
  SceneData data;
  data.parts.push_back({make_box({-1, -1, -1}, {1, 1, 1}), grey(0.5f), {}});
  Order order;
  order.size = 2;
  order.positions = {{1, 0.3, 0.2}, {1, 1, 0.2}, {1, 1, 1}, {1 + 1e-7, 0.3, 0.2}, {1.01, 0.3, 0.2}};
  State state = open(data, constant_environment({1, 1, 1}), order);
  const Baked baked = bake(state);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NE(baked.probes[i].surroundings.status, ProbeStatus::valid) << i;
  }
  EXPECT_EQ(baked.probes[0].surroundings.status, ProbeStatus::on_surface);
  EXPECT_EQ(baked.probes[4].surroundings.status, ProbeStatus::valid);
}

// The distance cube of a room of 20 m a side, seen from its middle: each face's plane at 10 m.
TEST(Probes, DistancesAreWorldUnits) {
  SceneData data = room(0.5f, 1);
  data.parts[0].mesh = scaled(data.parts[0].mesh, 10);
  State state = open(data, {}, {});
  const Baked baked = bake(state);
  for (int face = 0; face < 6; ++face) {
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        const Vec3d d = cube_texel_direction(face, x, y, 8);
        const double largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        const auto i = static_cast<size_t>((face * 8 + y) * 8 + x);
        EXPECT_NEAR(baked.probes[0].distance[i], 10 / largest, 1e-4);
      }
    }
  }
  EXPECT_NEAR(baked.probes[0].surroundings.distance_min, 10, 0.05);
  EXPECT_EQ(baked.probes[0].surroundings.hit_share, 1.0);
}

TEST(Probes, BytesDoNotDependOnThreadsOrChunks) {
  Order order;
  order.positions = {{0, 0, 0}, {0.5, 0.2, 0.5}, {0.3, -0.5, 0.6}};
  order.size = 5;
  order.max_samples = 128;
  std::vector<std::byte> expected;
  Plan plan;
  for (const int threads : {1, 2, 8}) {
    State state = open(colored_room(), gradient_sky(), order, threads);
    Progress progress;
    const Plan own = probes_plan(*state, progress);
    if (expected.empty()) plan = own;
    EXPECT_EQ(own.reference_luminance, plan.reference_luminance);
    EXPECT_EQ(own.max_bounces, plan.max_bounces);
    const ChunkResult whole = probes_chunk(*state, plan, {0, 3}, progress);
    if (expected.empty()) expected = whole.bytes;
    EXPECT_EQ(whole.bytes, expected) << threads;
    std::vector<std::byte> parts;
    for (const ElementRange& range : {ElementRange{0, 1}, ElementRange{1, 2}}) {
      const ChunkResult part = probes_chunk(*state, plan, range, progress);
      parts.insert(parts.end(), part.bytes.begin(), part.bytes.end());
    }
    EXPECT_EQ(parts, expected) << threads;
  }
}

TEST(Probes, BudgetEndsTheDoublings) {
  Order order;
  order.target = 0.0005;
  order.max_samples = 256;
  State state = open(colored_room(), {}, order);
  const Baked baked = bake(state);
  EXPECT_EQ(baked.probes[0].samples, 256u);
  EXPECT_NE(baked.probes[0].accuracy, AccuracyStatus::converged);
  EXPECT_GT(baked.probes[0].error, order.target);
  ASSERT_EQ(baked.chunk.report.rounds.size(), 3u);
  for (size_t i = 1; i < 3; ++i) {
    EXPECT_LT(baked.chunk.report.rounds[i].error_max, baked.chunk.report.rounds[i - 1].error_max);
  }
  EXPECT_EQ(baked.chunk.report.budget_limited, 1u);
}

TEST(Probes, SecondsPinTheSamples) {
  Order order;
  order.target = 0.0005;
  order.max_seconds = 1e-6;
  State state = open(colored_room(), {}, order);
  Progress progress;
  const Plan plan = probes_plan(*state, progress);
  EXPECT_EQ(plan.max_samples, 64u);
  ASSERT_FALSE(plan.warnings.empty());
  EXPECT_NE(plan.warnings.back().find("max_seconds"), std::string::npos);
  EXPECT_EQ(plan.prices.size(), 5u);
  for (size_t i = 1; i < 5; ++i) EXPECT_GE(plan.prices[i].seconds, plan.prices[i - 1].seconds);
}

TEST(Probes, DarkSceneIsToldAndFinite) {
  State state = open(room(0.5f, 0), {}, {});
  const Baked baked = bake(state);
  for (const float value : baked.probes[0].radiance) EXPECT_EQ(value, 0);
  ASSERT_FALSE(baked.plan.warnings.empty());
  EXPECT_NE(baked.plan.warnings.back().find("No light"), std::string::npos);
  EXPECT_EQ(baked.plan.reference_luminance, 1);
}

TEST(Probes, CancelEndsABakeUnderWay) {
  Order order;
  order.size = 64;
  order.target = 1e-4;
  State state = open(colored_room(), gradient_sky(), order, 2);
  Progress quiet;
  const Plan plan = probes_plan(*state, quiet);
  int updates = 0;
  Progress progress([&](double) { return ++updates < 5; });
  try {
    probes_chunk(*state, plan, {0, 1}, progress);
    FAIL() << "the bake was not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::cancelled);
  }
  EXPECT_LE(updates, 7);
}

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

// A sky of radiance 1 with a sun of one texel of a map of `height` rows: `sun` is what its term of
// L00 / y_00 is, radiance times solid angle.
struct Sunny {
  Environment sky;
  Vec3d direction;
  double energy = 0;
};
Sunny sunny(int height, int column, int row, double energy) {
  Sunny made;
  made.sky = constant_environment({1, 1, 1});
  made.sky.constant = false;
  made.sky.radiance = Image(2 * height, height, 3);
  std::fill(made.sky.radiance.pixels.begin(), made.sky.radiance.pixels.end(), 1.0f);
  const double omega = latlong_texel_solid_angle(row, 2 * height, height);
  const auto radiance = static_cast<float>(1 + energy / omega);
  for (int c = 0; c < 3; ++c) made.sky.radiance.at(column, row)[c] = radiance;
  made.direction =
      latlong_direction((column + 0.5) / (2 * height), (row + 0.5) / static_cast<double>(height));
  made.energy = (static_cast<double>(radiance) - 1) * omega;
  made.sky.max_luminance = static_cast<double>(radiance);
  const double mean = 1 + made.energy / (4 * kPi);
  made.sky.mean = {mean, mean, mean};
  return made;
}

// Under which the sky is hidden; what the sun adds to a coefficient is its energy times y_lm.
SceneData black_floor() {
  SceneData data;
  data.parts.push_back({make_quad({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}), grey(0), {}});
  return data;
}

TEST(Probes, SunSmallerThanATexelIsSeen) {
  for (const int height : {64, 2048}) {
    const int row = height / 4 + 1, column = height / 3;
    const Sunny lit = sunny(height, column, row, 12);
    const Sunny plain = sunny(height, column, row, 0);
    for (const int size : {8, 64}) {
      Order order;
      order.positions = {{0, 1, 0}};
      order.size = size;
      order.bands = 2;
      order.max_samples = size == 8 ? 1024 : 64;
      State bright = open(black_floor(), lit.sky, order, 2);
      State dull = open(black_floor(), plain.sky, order, 2);
      Progress progress;
      const Baked baked = bake(bright), without = bake(dull);
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
    if (height == 2048) {
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
    Order order;
    order.positions = {{0, -0.2, 0}};
    order.size = size;
    order.target = 0.2;
    if (size == 64) order.max_samples = 64;
    State state = open(data, {}, order);
    const Baked baked = bake(state);
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
    State state =
        open(black_floor(), constant ? constant_environment({1, 1, 1}) : gradient_sky(), {});
    Order order;
    EXPECT_EQ(bake(state).chunk.report.counters.shadow_rays, 0u);
  }
}

// 95 % half-widths of texels against a truth of 64 times the samples.
TEST(Probes, ErrorBarsCoverTheTruth) {
  const LitScene lit(colored_room(), {}, bounces(3));
  const CubeTexels texels = all_texels(8);
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
