// Claims: who gets which task, and what its lease is worth.

#include <unistd.h>

#include "tests/store/contract.h"

namespace lightkiln::test {
namespace {

TEST_F(StoreContract, ClaimsGoByPriorityThenAgeAndPreferTheJobInHand) {
  const std::string old = submit("old");
  const std::string young = submit("young");
  Submission urgent = order("urgent");
  urgent.priority = 5;
  const std::string first = store->submit(urgent).job_id;
  EXPECT_EQ(take().job_id, first);
  EXPECT_EQ(store->claim("w", young)->job_id, young);
  EXPECT_EQ(store->claim("w", first)->job_id, old) << "a preferred job without work is passed over";
}

TEST_F(StoreContract, AMoreUrgentOrderComesBeforeTheJobInHand) {
  const std::string in_hand = submit("in hand");
  plan(3);
  EXPECT_EQ(store->claim("w", in_hand)->job_id, in_hand);
  Submission urgent = order("urgent");
  urgent.priority = 1;
  const std::string soon = store->submit(urgent).job_id;
  Submission idle = order("idle");
  idle.priority = -1;
  store->submit(idle);
  EXPECT_EQ(store->claim("w", in_hand)->job_id, soon);
  EXPECT_EQ(store->claim("w", in_hand)->job_id, in_hand);
}

TEST_F(StoreContract, AStaleLeaseChangesNothing) {
  reopen(1);
  const std::string id = submit();
  const Claim stale = take("slow");
  usleep(5000);
  const Claim fresh = take("quick");
  EXPECT_NE(stale.lease, fresh.lease);
  const uint64_t version = job(id).version;
  EXPECT_FALSE(store->heartbeat(stale, 0.5));
  store->commit_plan(stale, "{}", 7, 1);
  store->fail_task(stale, {"internal", "No.", ""}, false);
  store->release(stale, "No.");
  EXPECT_EQ(job(id).version, version);
  store->commit_plan(fresh, R"({"plan":2})", 1, 1);
  EXPECT_EQ(job(id).plan_json, R"({"plan":2})");

  const Claim stale_chunk = take("slow");
  usleep(5000);
  const Claim fresh_chunk = take("quick");
  chunk(stale_chunk, "stale");
  EXPECT_EQ(job(id).chunks_done, 0u);
  EXPECT_EQ(blob_files(), 0u) << "the bytes of a refused commit are swept";
  chunk(fresh_chunk, "fresh");
  chunk(fresh_chunk, "again");
  EXPECT_EQ(job(id).chunks_done, 1u) << "a commit counts once";
}

TEST_F(StoreContract, AHeartbeatKeepsTheLease) {
  reopen(300);
  const std::string id = submit();
  const Claim claim = take();
  for (int i = 0; i < 8; ++i) {
    usleep(60'000);
    EXPECT_TRUE(store->heartbeat(claim, 0.1 * i));
    EXPECT_FALSE(store->claim("other", ""));
  }
  EXPECT_DOUBLE_EQ(job(id).chunk_fraction, 0.7);
}

TEST_F(StoreContract, TheThirdLostLeaseFailsTheJobWithItsCause) {
  reopen(1);
  const std::string id = submit();
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(store->claim("w", ""));
    usleep(5000);
  }
  EXPECT_FALSE(store->claim("w", ""));
  EXPECT_EQ(job(id).state, JobState::failed);
  EXPECT_EQ(job(id).error->code, "worker_lost");
  EXPECT_EQ(job(id).attempts, 0);
}

TEST_F(StoreContract, ACrashIsTriedTwiceAndThenNamed) {
  const std::string id = submit();
  store->fail_task(take(), {"oven_crashed", "The oven died by signal 11.", ""}, true);
  EXPECT_EQ(job(id).state, JobState::running);
  EXPECT_EQ(job(id).attempts, 1);
  EXPECT_NE(job(id).reason.find("signal 11"), std::string::npos);
  store->fail_task(take(), {"oven_crashed", "The oven died by signal 6.", ""}, true);
  EXPECT_EQ(job(id).state, JobState::failed);
  EXPECT_EQ(job(id).attempts, 2);
  EXPECT_EQ(job(id).error->detail, "The oven died by signal 6.");
}

TEST_F(StoreContract, AnErrorFailsTheJobAtOnceWithItsPointer) {
  const std::string id = submit();
  store->fail_task(take(), {"invalid_input", "Accessor 3 ends outside its buffer.", "/accessors/3"},
                   false);
  EXPECT_EQ(job(id).state, JobState::failed);
  EXPECT_EQ(job(id).error->pointer, "/accessors/3");
}

TEST_F(StoreContract, ReleaseGivesTheTaskBackUncounted) {
  const std::string id = submit();
  for (int i = 0; i < 5; ++i) store->release(take(), "Waiting for rain.");
  EXPECT_EQ(job(id).reason, "Waiting for rain.");
  EXPECT_EQ(job(id).attempts, 0);
  EXPECT_TRUE(store->claim("w", ""));
}

}  // namespace
}  // namespace lightkiln::test
