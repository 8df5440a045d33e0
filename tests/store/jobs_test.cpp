// Jobs: their end at a client's word, and what lists, waits and health tell of them.

#include <thread>

#include <unistd.h>

#include "tests/store/contract.h"

namespace lightkiln::test {
namespace {

TEST_F(StoreContract, CancelEndsAtOnceAndTheWorkerLearnsIt) {
  const std::string id = submit();
  const Claim claim = take();
  store->cancel(id);
  EXPECT_EQ(job(id).state, JobState::cancelled);
  EXPECT_FALSE(store->heartbeat(claim, 0.5));
  store->commit_plan(claim, "{}", 1, 1);
  EXPECT_EQ(job(id).state, JobState::cancelled);
  EXPECT_EQ(code_of([&] { store->cancel(id); }), ErrorCode::conflict);
  EXPECT_EQ(code_of([&] { store->cancel("nobody"); }), ErrorCode::not_found);
  EXPECT_FALSE(store->claim("w", ""));
}

TEST_F(StoreContract, RemoveTakesTheJobAndWhatNobodyElseNeeds) {
  const std::string upload = store->put_blob(bytes_of("the glb"));  // equal to an artifact's bytes
  const std::string id = submit("one");
  EXPECT_EQ(blob_files(), 1u);
  plan(1);
  const Claim running = take();
  EXPECT_EQ(code_of([&] { store->remove(id); }), ErrorCode::conflict);
  chunk(running, "zero");
  result(take());
  EXPECT_EQ(blob_files(), 2u);
  store->remove(id);
  EXPECT_FALSE(store->find_job(id));
  EXPECT_TRUE(store->events(id, 0, 10).empty());
  EXPECT_EQ(blob_files(), 1u);
  EXPECT_TRUE(store->has_blob(upload)) << "what a client sent is not ours to remove";
  EXPECT_EQ(code_of([&] { store->remove(id); }), ErrorCode::not_found);
}

TEST_F(StoreContract, IdsAndEventsRiseAndSurviveReopening) {
  std::string last;
  for (int i = 0; i < 200; ++i) {
    const std::string id = submit("job " + std::to_string(i));
    EXPECT_GT(id, last);
    last = id;
    if (i == 100) reopen(15000);
  }
  uint64_t sequence = 0;
  for (const EventRecord& event : store->events("", 0, 1000)) {
    EXPECT_GT(event.sequence, sequence);
    sequence = event.sequence;
  }
  EXPECT_GE(sequence, 200u);
}

TEST_F(StoreContract, ListsFilterAndPageNewestFirst) {
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) {
    Submission submission = order("room " + std::to_string(i));
    submission.labels = {{"shot", i % 2 ? "odd" : "even"}};
    if (i == 4) submission.kind = "probes";
    ids.push_back(store->submit(submission).job_id);
  }
  store->cancel(ids[1]);
  const auto listed = [&](const JobFilter& filter) {
    std::vector<std::string> found;
    for (const JobRecord& record : store->list_jobs(filter)) found.push_back(record.id);
    return found;
  };
  using Ids = std::vector<std::string>;
  JobFilter filter;
  filter.limit = 2;
  EXPECT_EQ(listed(filter), (Ids{ids[4], ids[3]}));
  filter.after = ids[3];
  EXPECT_EQ(listed(filter), (Ids{ids[2], ids[1]}));
  filter = {};
  filter.label = {"shot", "odd"};
  EXPECT_EQ(listed(filter), (Ids{ids[3], ids[1]}));
  filter.state = JobState::cancelled;
  EXPECT_EQ(listed(filter), (Ids{ids[1]}));
  filter = {};
  filter.kind = "probes";
  EXPECT_EQ(listed(filter), (Ids{ids[4]}));
  filter = {};
  filter.text = "ROOM 2";
  EXPECT_EQ(listed(filter), (Ids{ids[2]}));
  EXPECT_EQ(store->list_jobs({})[0].labels.at("shot"), "even");
}

TEST_F(StoreContract, WaitingReturnsAtTheChangeAndNotBefore) {
  const std::string id = submit();
  const uint64_t version = job(id).version;
  EXPECT_EQ(store->wait_job(id, version, 20)->version, version);
  std::thread other([&] {
    usleep(30'000);
    store->cancel(id);
  });
  EXPECT_EQ(store->wait_job(id, version, 10'000)->state, JobState::cancelled);
  other.join();
  EXPECT_FALSE(store->wait_job("nobody", 0, 10));
}

TEST_F(StoreContract, VersionsRiseWithEveryVisibleChange) {
  const uint64_t empty = store->list_version();
  const std::string id = submit();
  const uint64_t submitted = store->list_version();
  EXPECT_GT(submitted, empty);
  const Claim claim = take();
  const uint64_t claimed = job(id).version;
  EXPECT_GT(claimed, submitted);
  EXPECT_TRUE(store->heartbeat(claim, 0.25));
  EXPECT_GT(job(id).version, claimed);
  store->cancel(id);
  store->remove(id);
  EXPECT_GT(store->list_version(), claimed + 1);
}

TEST_F(StoreContract, HealthCountsWhatWaitsAndRuns) {
  submit("one");
  submit("two");
  take();
  const StoreHealth health = store->health();
  EXPECT_TRUE(health.writable) << health.detail;
  EXPECT_EQ(health.queued, 1u);
  EXPECT_EQ(health.running, 1u);
  EXPECT_EQ(health.overdue, 0u);
  EXPECT_EQ(store->counts().at("ambient_occlusion/queued"), 1u);
}

TEST_F(StoreContract, ThreadsShareOneStore) {
  constexpr int kThreads = 4, kJobs = 8;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < kJobs; ++i) {
        const std::string id = submit(std::to_string(t) + "-" + std::to_string(i));
        const std::optional<Claim> claim = store->claim("thread " + std::to_string(t), id);
        if (claim) store->commit_plan(*claim, "{}", 1, 1);
        store->list_jobs({});
        store->wait_job(id, 0, 10);
        store->health();
      }
    });
  for (std::thread& thread : threads) thread.join();
  int planned = 0;
  for (const JobRecord& record : store->list_jobs({}))
    planned += record.stage == JobStage::bake ? 1 : 0;
  EXPECT_EQ(planned, kThreads * kJobs);
}

}  // namespace
}  // namespace lightkiln::test
