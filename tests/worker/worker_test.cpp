// Orders through a real worker and a real oven: results, failures, cancelling, an orderly end.

#include "server/worker/worker.h"

#include <csignal>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "server/worker/feed.h"
#include "server/worker/sandbox_policy.h"
#include "tests/support/gltf_builder.h"
#include "tests/worker/house.h"

namespace lightkiln::test {
namespace {

TEST(Worker, BakesFromSubmissionToArtifacts) {
  House house;
  const std::string id = house.order(one_triangle(), kCoarse);
  const JobRecord job = house.bake(id, house.worker_options());
  ASSERT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : job.reason);
  EXPECT_FALSE(job.plan_json.empty());
  EXPECT_FALSE(job.accuracy_json.empty());
  std::set<std::string> roles, names;
  for (const ArtifactRecord& artifact : house.store().artifacts(id)) {
    roles.insert(artifact.role);
    names.insert(artifact.name);
    EXPECT_GT(artifact.bytes, 0u);
  }
  for (const char* role : {"document", "plan", "accuracy", "preview"})
    EXPECT_TRUE(roles.contains(role)) << role;
  for (const char* name : {"ambient_occlusion.json", "plan.json", "accuracy.json"})
    EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Worker, APlanOnlyOrderBakesNothing) {
  House house;
  const std::string id = house.order(one_triangle(), kCoarse, true);
  const JobRecord job = house.bake(id, house.worker_options());
  EXPECT_EQ(job.state, JobState::succeeded);
  EXPECT_FALSE(job.plan_json.empty());
  EXPECT_EQ(job.chunks_done, 0u);
}

TEST(Worker, TheSameBytesForAnyThreadsAndChunkSizes) {
  ASSERT_FALSE(undisturbed().empty());
  for (const int threads : {1, 2, 8})
    for (const double chunk_seconds : {1000.0, 0.002}) {
      House house;
      WorkerOptions options = house.worker_options();
      options.threads = threads;
      options.chunk_seconds = chunk_seconds;
      const std::string id = house.order(box_on_a_floor(60), kCoarse);
      const JobRecord job = house.bake(id, options);
      EXPECT_EQ(job.state, JobState::succeeded);
      if (chunk_seconds < 1) {
        EXPECT_GT(job.chunks_total, 1u);
      }
      EXPECT_EQ(house.timeless_digests(id), undisturbed()) << threads << " " << chunk_seconds;
    }
}

TEST(Worker, AMalformedSceneFailsWithItsPlace) {
  House house;
  const std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
      R"("accessors":[{"componentType":5126,"count":3,"type":"VEC3","bufferView":9}]})";
  const std::string id = house.order(make_glb_container(json, {}), kCoarse);
  const JobRecord job = house.bake(id, house.worker_options());
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "invalid_input");
  EXPECT_NE(job.error->pointer.find("/accessors/0"), std::string::npos) << job.error->pointer;
  EXPECT_FALSE(job.error->detail.empty());
  EXPECT_EQ(job.attempts, 1) << "an input's fault is not tried again";
}

TEST(Worker, AHungryInputEndsAsOutOfMemoryAfterTwoTries) {
  House house;
  WorkerOptions options = house.worker_options();
  options.oven_memory_bytes = 4096;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  const JobRecord job = house.bake(id, options);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "out_of_memory") << job.error->detail;
  EXPECT_EQ(job.attempts, 2);
}

// The limit above is the ray tracer's own; this one is the kernel's, for everything else.
TEST(Worker, AnInputOverTheAddressSpaceEndsAsOutOfMemory) {
#ifdef LIGHTKILN_SANITIZED
  GTEST_SKIP() << "the address space cannot be limited with a sanitizer";
#endif
  House house;
  std::string hdr = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2048 +X 4096\n";
  hdr.append(2048 * 4096 * 4, '\x7f');
  const auto* data = reinterpret_cast<const std::byte*>(hdr.data());
  const std::string digest = house.store().put_blob({data, data + hdr.size()});
  Claim claim;
  claim.spec_json = R"({"kind":"environment_maps","inputs":{"environment":")" + digest +
                    R"("},"parameters":{"sh":{"bands":3}}})";
  const auto plan_within = [&](uint64_t address_space_besides) -> std::string {
    OvenProcess oven({house.worker_options().oven_path, 64u << 20, address_space_besides},
                     [] { return false; });
    read_greeting(oven, -1);
    try {
      feed_job(oven, house.store(), claim, {1, 64u << 20, 4.0}, [](double) {});
      feed_plan(oven, [](double) {});
    } catch (const OvenFailure& failure) {
      EXPECT_TRUE(failure.crashed) << "worth another try";
      return failure.error.code;
    }
    return "planned";
  };
  EXPECT_EQ(plan_within(2ull << 30), "planned");
  EXPECT_EQ(plan_within(64ull << 20), "out_of_memory") << "less than the map's pixels take";
}

TEST(Worker, AnEndlessTaskTimesOutAfterTwoTries) {
  House house;
  WorkerOptions options = house.worker_options();
  options.task_seconds = 1;  // not so short that planning runs into it on a busy machine
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const JobRecord job = house.bake(id, options);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "timed_out") << job.error->detail;
  EXPECT_EQ(job.attempts, 2);
}

TEST(Worker, ACancelMidBakeEndsTheOven) {
  House house;
  WorkerOptions options = house.worker_options();
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const pid_t worker = house.start_worker(options);
  ASSERT_TRUE(eventually([&] { return house.job(id).stage == JobStage::bake; }));
  usleep(200'000);
  const std::vector<pid_t> before = children_of(worker);
  ASSERT_EQ(before.size(), 2u) << "one at work, one in reserve";
  const double cancelled_s = wall_seconds();
  house.store().cancel(id);
  ASSERT_TRUE(eventually([&] { return !is_running(before[0]) || !is_running(before[1]); }));
  RecordProperty("milliseconds", static_cast<int>((wall_seconds() - cancelled_s) * 1000));
  EXPECT_EQ(house.job(id).state, JobState::cancelled);
  const std::string after = house.order(one_triangle(), kCoarse);
  EXPECT_TRUE(eventually([&] { return house.job(after).state == JobState::succeeded; }));
}

TEST(Worker, SigtermGivesTheClaimBackUncounted) {
  House house;
  WorkerOptions options = house.worker_options();
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  for (int i = 0; i < 4; ++i) {
    const pid_t worker = house.start_worker(options);
    ASSERT_TRUE(eventually([&] {
      return house.job(id).stage == JobStage::bake &&
             house.store().counts().at("leased_tasks") == 1;
    }));
    EXPECT_EQ(house.end_process(worker, SIGTERM), 0);
    EXPECT_EQ(house.job(id).state, JobState::running);
    EXPECT_NE(house.job(id).reason.find("shut down"), std::string::npos);
  }
  EXPECT_EQ(house.job(id).attempts, 0);
}

TEST(Worker, AMissingOvenIsSaid) {
  House house;
  WorkerOptions options = house.worker_options();
  options.oven_path = "/nowhere/kiln-oven";
  try {
    run_worker(options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unavailable);
    EXPECT_NE(std::string(error.what()).find("/nowhere/kiln-oven"), std::string::npos);
  }
}

}  // namespace
}  // namespace lightkiln::test
