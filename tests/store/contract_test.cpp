// The promises of server/store/store.h, held against the embedded store.

#include <filesystem>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include "server/store/store.h"
#include "tests/store/whole.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

class StoreContract : public testing::Test {
 protected:
  StoreContract() { reopen(15000); }

  void reopen(int64_t lease_ms) {
    store.reset();
    StoreOptions options;
    options.directory = (folder.path() / "store").string();
    options.lease_ms = lease_ms;
    options.min_free_bytes = 0;
    store = open_sqlite_store(options);
  }

  static Submission order(const std::string& name = "job", const std::string& digest = "") {
    Submission submission;
    submission.name = name;
    submission.kind = "ambient_occlusion";
    submission.spec_json = "{}";
    submission.spec_digest = digest.empty() ? "sha256:spec-of-" + name : digest;
    submission.target_error = 0.02;
    return submission;
  }
  std::string submit(const std::string& name = "job") { return store->submit(order(name)).job_id; }
  JobRecord job(const std::string& id) { return store->find_job(id).value(); }

  ErrorCode code_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const Error& error) {
      return error.code();
    }
    ADD_FAILURE() << "no Error was thrown";
    return ErrorCode::internal;
  }

  Claim take(const std::string& worker = "w") { return store->claim(worker, "").value(); }
  void plan(uint64_t chunks) { store->commit_plan(take(), R"({"plan":1})", chunks, 2.5); }
  void chunk(const Claim& claim, const std::string& bytes, double error_sum_sq = 0.04) {
    store->commit_chunk(claim,
                        {bytes_of(bytes), "{\"report\":\"" + bytes + "\"}", 4, error_sum_sq});
  }
  void result(const Claim& claim) {
    test::commit_result(*store, claim,
                        {{"ao.glb", "glb", "model/gltf-binary", bytes_of("the glb")},
                         {"ao.exr", "image", "image/x-exr", bytes_of("the exr")}},
                        R"({"accuracy":1})");
  }
  void bake_to_the_end(uint64_t chunks = 2) {
    plan(chunks);
    for (uint64_t i = 0; i < chunks; ++i) chunk(take(), "chunk " + std::to_string(i));
    result(take());
  }
  std::vector<std::string> event_types(const std::string& id) {
    std::vector<std::string> types;
    for (const EventRecord& event : store->events(id, 0, 100)) types.push_back(event.type);
    return types;
  }
  void damage_every_blob() {
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(folder.path() / "store" / "blobs"))
      if (entry.is_regular_file()) test::write_file(entry.path(), bytes_of("rot!"));
  }
  size_t blob_files() {
    size_t count = 0;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(folder.path() / "store" / "blobs"))
      count += entry.is_regular_file() ? 1 : 0;
    return count;
  }

  test::TemporaryFolder folder;
  std::unique_ptr<Store> store;
};

TEST_F(StoreContract, AnOrderGoesFromSubmissionToArtifacts) {
  const std::string id = submit();
  EXPECT_EQ(id.size(), 26u);
  EXPECT_EQ(job(id).state, JobState::queued);
  EXPECT_FALSE(job(id).reason.empty());

  const Claim planning = take();
  EXPECT_EQ(planning.type, TaskType::plan);
  EXPECT_EQ(job(id).state, JobState::running);
  EXPECT_GT(job(id).started_ms, 0);
  store->commit_plan(planning, R"({"plan":1})", 2, 2.5);
  EXPECT_EQ(job(id).stage, JobStage::bake);
  EXPECT_EQ(job(id).chunks_total, 2u);
  EXPECT_EQ(job(id).predicted_s, 2.5);

  const Claim first = take();
  EXPECT_EQ(first.type, TaskType::chunk);
  EXPECT_EQ(first.plan_json, R"({"plan":1})");
  const Claim second = take();
  EXPECT_EQ(second.chunk_index, 1u);
  EXPECT_FALSE(store->claim("w", ""));
  chunk(second, "second", 0.05);
  EXPECT_FALSE(store->claim("w", "")) << "assembling waits for every chunk";
  chunk(first, "first", 0.03);
  EXPECT_DOUBLE_EQ(job(id).current_error, 0.1);  // sqrt((0.05 + 0.03) / 8)

  const Claim assembling = take();
  EXPECT_EQ(assembling.type, TaskType::assemble);
  const std::vector<StoredChunk> chunks = test::load_chunks(*store, id);
  ASSERT_EQ(chunks.size(), 2u);
  EXPECT_EQ(chunks[0].bytes, bytes_of("first"));
  EXPECT_EQ(chunks[1].bytes, bytes_of("second"));
  EXPECT_TRUE(store->artifacts(id).empty());
  result(assembling);

  const JobRecord done = job(id);
  EXPECT_EQ(done.state, JobState::succeeded);
  EXPECT_EQ(done.stage, JobStage::done);
  EXPECT_EQ(done.plan_json, R"({"plan":1})");
  EXPECT_EQ(done.accuracy_json, R"({"accuracy":1})");
  EXPECT_GT(done.finished_ms, 0);
  const std::vector<ArtifactRecord> artifacts = store->artifacts(id);
  ASSERT_EQ(artifacts.size(), 2u);
  EXPECT_EQ(artifacts[0].name, "ao.glb");
  EXPECT_EQ(artifacts[0].bytes, 7u);
  uint64_t size = 0;
  const int fd = store->open_blob(artifacts[1].digest, &size);
  char text[8] = {};
  EXPECT_EQ(read(fd, text, 8), 7);
  EXPECT_STREQ(text, "the exr");
  close(fd);
  EXPECT_EQ(store->chunk_reports(id).size(), 2u);
  EXPECT_EQ(blob_files(), 2u) << "the chunks' bytes are gone with the job's end";
  EXPECT_EQ(event_types(id),
            (std::vector<std::string>{"state", "state", "plan", "state", "chunk", "chunk", "state",
                                      "artifact", "artifact", "state"}));
}

TEST_F(StoreContract, APlanOnlyOrderSucceedsWithItsPlan) {
  Submission submission = order();
  submission.plan_only = true;
  const std::string id = store->submit(submission).job_id;
  plan(3);
  EXPECT_EQ(job(id).state, JobState::succeeded);
  EXPECT_FALSE(store->claim("w", ""));
  Submission bake = order();
  EXPECT_EQ(job(store->submit(bake).job_id).state, JobState::queued) << "a plan is no result";
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

TEST_F(StoreContract, RetryKeepsFinishedChunks) {
  const std::string id = submit();
  EXPECT_EQ(code_of([&] { store->retry(id); }), ErrorCode::conflict);
  plan(3);
  chunk(take(), "zero");
  store->fail_task(take(), {"internal", "No.", ""}, false);
  store->retry(id);
  EXPECT_EQ(job(id).state, JobState::queued);
  EXPECT_FALSE(job(id).error);
  EXPECT_EQ(take().chunk_index, 1u);
  EXPECT_EQ(job(id).chunks_done, 1u);
  EXPECT_EQ(job(id).state, JobState::running);
}

TEST_F(StoreContract, RetryBakesAChunkAgainWhoseBytesWereLost) {
  const std::string id = submit();
  plan(1);
  chunk(take(), "zero");
  const Claim assembling = take();
  damage_every_blob();
  EXPECT_EQ(code_of([&] { test::load_chunks(*store, id); }), ErrorCode::internal);
  store->fail_task(assembling, {"internal", "No.", ""}, false);
  store->retry(id);
  const Claim again = take();
  EXPECT_EQ(again.type, TaskType::chunk);
  chunk(again, "zero");
  result(take());
  EXPECT_EQ(job(id).state, JobState::succeeded);
}

TEST_F(StoreContract, AssemblingSendsADamagedChunkBackToBaking) {
  const std::string id = submit();
  plan(2);
  chunk(take(), "zero");
  chunk(take(), "one");
  const Claim assembling = take();
  EXPECT_FALSE(store->rebake_lost_chunks(assembling)) << "nothing is lost yet";
  damage_every_blob();
  EXPECT_EQ(code_of([&] { test::load_chunks(*store, id); }), ErrorCode::internal);
  Claim stale = assembling;
  ++stale.lease;
  EXPECT_FALSE(store->rebake_lost_chunks(stale));
  EXPECT_TRUE(store->rebake_lost_chunks(assembling));
  EXPECT_EQ(job(id).state, JobState::running);
  EXPECT_EQ(job(id).stage, JobStage::bake);
  EXPECT_EQ(job(id).chunks_done, 1u) << "loading stops at the first one that is damaged";
  const Claim again = take();
  EXPECT_EQ(again.type, TaskType::chunk);
  EXPECT_EQ(again.chunk_index, 0u);
  chunk(again, "zero");
  EXPECT_EQ(code_of([&] { test::load_chunks(*store, id); }), ErrorCode::internal);
  EXPECT_TRUE(store->rebake_lost_chunks(take()));
  chunk(take(), "one");
  const Claim whole = take();
  EXPECT_EQ(test::load_chunks(*store, id).size(), 2u);
  result(whole);
  EXPECT_EQ(job(id).state, JobState::succeeded);
}

TEST_F(StoreContract, AChunkDamagedAgainAndAgainFailsTheJob) {
  const std::string id = submit();
  plan(1);
  for (int i = 0; i < 2; ++i) {
    chunk(take(), "zero");
    const Claim assembling = take();
    damage_every_blob();
    EXPECT_EQ(code_of([&] { test::load_chunks(*store, id); }), ErrorCode::internal);
    EXPECT_TRUE(store->rebake_lost_chunks(assembling));
  }
  EXPECT_EQ(job(id).state, JobState::failed);
  EXPECT_NE(job(id).error->detail.find("damaged"), std::string::npos);
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

TEST_F(StoreContract, AnEqualOrderIsAnsweredFromTheStore) {
  const std::string first = submit("same");
  bake_to_the_end();
  const std::string second = submit("same");
  const JobRecord record = job(second);
  EXPECT_EQ(record.state, JobState::succeeded);
  EXPECT_TRUE(record.from_cache);
  EXPECT_EQ(record.plan_json, job(first).plan_json);
  EXPECT_EQ(record.accuracy_json, job(first).accuracy_json);
  EXPECT_EQ(record.chunks_done, 2u);
  EXPECT_EQ(store->artifacts(second)[0].digest, store->artifacts(first)[0].digest);
  EXPECT_EQ(store->chunk_reports(second), store->chunk_reports(first));
  store->remove(first);
  EXPECT_EQ(blob_files(), 2u) << "the second job still refers to the artifacts";
  EXPECT_EQ(job(submit("other")).state, JobState::queued);
}

TEST_F(StoreContract, AnEqualKeyAndBodyReplaysAndAnotherBodyIsRefused) {
  Submission submission = order();
  submission.idempotency_key = "key";
  submission.request_digest = "body";
  const SubmitResult first = store->submit(submission);
  const SubmitResult second = store->submit(submission);
  EXPECT_FALSE(first.replayed);
  EXPECT_TRUE(second.replayed);
  EXPECT_EQ(first.job_id, second.job_id);
  submission.request_digest = "another body";
  EXPECT_EQ(code_of([&] { store->submit(submission); }), ErrorCode::conflict);
  store->remove(first.job_id);
  EXPECT_FALSE(store->submit(submission).replayed);
}

TEST_F(StoreContract, AReplayOfAJobWithLostArtifactsIsBakedAnew) {
  Submission submission = order();
  submission.idempotency_key = "key";
  submission.request_digest = "body";
  const std::string broken = store->submit(submission).job_id;
  bake_to_the_end();
  EXPECT_TRUE(store->submit(submission).replayed);
  reopen(15000);
  damage_every_blob();
  const std::string digest = store->artifacts(broken)[0].digest;
  EXPECT_EQ(code_of([&] { store->open_blob(digest, nullptr); }), ErrorCode::internal);
  const SubmitResult anew = store->submit(submission);
  EXPECT_FALSE(anew.replayed);
  EXPECT_NE(anew.job_id, broken);
  EXPECT_FALSE(job(anew.job_id).from_cache);
  bake_to_the_end();
  EXPECT_EQ(store->submit(submission).job_id, anew.job_id) << "the key names the new job";
  for (const std::string& id : {broken, anew.job_id})
    for (const ArtifactRecord& artifact : store->artifacts(id))
      close(store->open_blob(artifact.digest, nullptr));
}

TEST_F(StoreContract, MissingInputsAreNamed) {
  Submission submission = order();
  const std::string absent = "sha256:" + std::string(64, 'a');
  submission.inputs = {store->put_blob(bytes_of("here")), absent};
  try {
    store->submit(submission);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::not_found);
    EXPECT_NE(std::string(error.what()).find(absent), std::string::npos);
  }
}

TEST_F(StoreContract, UploadsAreCheckedAndDamageIsSetAside) {
  const std::string digest = store->put_blob(bytes_of("abc"));
  EXPECT_EQ(digest, "sha256:ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  auto upload = store->begin_upload();
  upload->append("ab", 2);
  upload->append("c", 1);
  EXPECT_FALSE(upload->commit(digest)) << "known already";
  upload = store->begin_upload();
  upload->append("abd", 3);
  EXPECT_EQ(code_of([&] { upload->commit(digest); }), ErrorCode::invalid_input);
  upload.reset();
  EXPECT_EQ(blob_files(), 1u);

  reopen(15000);
  const auto path = folder.path() / "store" / "blobs" / "ba" / digest.substr(7);
  test::write_file(path, bytes_of("abX"));
  EXPECT_EQ(code_of([&] { store->open_blob(digest, nullptr); }), ErrorCode::internal);
  EXPECT_FALSE(store->has_blob(digest));
  EXPECT_EQ(code_of([&] { store->open_blob(digest, nullptr); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] { store->has_blob("sha256:../../etc/passwd"); }), ErrorCode::invalid_input);
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

TEST_F(StoreContract, ReleaseGivesTheTaskBackUncounted) {
  const std::string id = submit();
  for (int i = 0; i < 5; ++i) store->release(take(), "Waiting for rain.");
  EXPECT_EQ(job(id).reason, "Waiting for rain.");
  EXPECT_EQ(job(id).attempts, 0);
  EXPECT_TRUE(store->claim("w", ""));
}

TEST_F(StoreContract, AFullQueueAndAFullDiskSayTryAgain) {
  store.reset();
  StoreOptions options;
  options.directory = (folder.path() / "small").string();
  options.min_free_bytes = 0;
  options.max_queued = 1;
  store = open_sqlite_store(options);
  submit("one");
  const auto refusal = [](const auto& attempt) -> std::string {
    try {
      attempt();
    } catch (const StoreRefusal& error) {
      EXPECT_EQ(error.code(), ErrorCode::unavailable);
      return error.problem_code();
    }
    return "";
  };
  EXPECT_EQ(refusal([&] { submit("two"); }), kQueueFull);
  options.min_free_bytes = uint64_t{1} << 62;
  store = open_sqlite_store(options);
  EXPECT_EQ(refusal([&] { submit("three"); }), kStorageFull);
  EXPECT_EQ(refusal([&] { store->put_blob({}); }), kStorageFull);
  EXPECT_FALSE(store->health().writable);
}

TEST_F(StoreContract, AResultThatIsNotCommittedLeavesNothing) {
  const std::string id = submit();
  plan(1);
  chunk(take(), "chunk");
  const Claim assembling = take();
  const size_t before = blob_files();
  {
    const auto result = store->begin_result(assembling);
    result->add({"large", "image", "x/y", std::vector<std::byte>(65u << 20)});
    EXPECT_EQ(blob_files(), before + 1) << "a large artifact is not held until the end";
    EXPECT_TRUE(store->artifacts(id).empty());
  }
  EXPECT_EQ(blob_files(), before);
  const auto late = store->begin_result(assembling);
  late->add({"small", "image", "x/y", bytes_of("small")});
  store->cancel(id);
  late->commit("{}");
  EXPECT_EQ(job(id).state, JobState::cancelled);
  EXPECT_TRUE(store->artifacts(id).empty());
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

}  // namespace
}  // namespace lightkiln
