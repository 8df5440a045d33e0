// Orders and their inputs: what submitting one does, and which are answered from the store.

#include <unistd.h>

#include "tests/store/contract.h"

namespace lightkiln::test {
namespace {

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
  const std::vector<StoredChunk> chunks = load_chunks(*store, id);
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
  write_file(path, bytes_of("abX"));
  EXPECT_EQ(code_of([&] { store->open_blob(digest, nullptr); }), ErrorCode::internal);
  EXPECT_FALSE(store->has_blob(digest));
  EXPECT_EQ(code_of([&] { store->open_blob(digest, nullptr); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] { store->has_blob("sha256:../../etc/passwd"); }), ErrorCode::invalid_input);
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

}  // namespace
}  // namespace lightkiln::test
