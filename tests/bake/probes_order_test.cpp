#include <algorithm>
#include <functional>

#include <gtest/gtest.h>

#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

TEST(Probes, TornChunksAreRefused) {
  ProbesOrder order;
  order.size = 2;
  order.max_bounces = 0;
  order.positions = {{0, 0, 0}, {0.1, 0, 0}};
  ProbesHandle state = open_probes(room(0.5f, 1), {}, order);
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

TEST(Probes, BytesDoNotDependOnThreadsOrChunks) {
  ProbesOrder order;
  order.positions = {{0, 0, 0}, {0.5, 0.2, 0.5}, {0.3, -0.5, 0.6}};
  order.size = 5;
  order.max_bounces = 3;
  order.max_samples = 128;
  std::vector<std::byte> expected;
  Plan plan;
  for (const int threads : {1, 2, 8}) {
    ProbesHandle state = open_probes(colored_room(), gradient_sky(), order, threads);
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
  ProbesOrder order;
  order.target = 0.0005;
  order.max_samples = 256;
  ProbesHandle state = open_probes(colored_room(), {}, order);
  const BakedProbes baked = bake_probes(state);
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
  ProbesOrder order;
  order.target = 0.0005;
  order.max_seconds = 1e-6;
  ProbesHandle state = open_probes(colored_room(), {}, order);
  Progress progress;
  const Plan plan = probes_plan(*state, progress);
  EXPECT_EQ(plan.max_samples, 64u);
  ASSERT_FALSE(plan.warnings.empty());
  EXPECT_NE(plan.warnings.back().find("max_seconds"), std::string::npos);
  EXPECT_EQ(plan.prices.size(), 5u);
  for (size_t i = 1; i < 5; ++i) EXPECT_GE(plan.prices[i].seconds, plan.prices[i - 1].seconds);
}

TEST(Probes, CancelEndsABakeUnderWay) {
  ProbesOrder order;
  order.size = 16;
  order.target = 1e-4;
  ProbesHandle state = open_probes(colored_room(), gradient_sky(), order, 2);
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

}  // namespace
}  // namespace lightkiln::test
