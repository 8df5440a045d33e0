// Chunks and results: what is kept of a job's work, and what is baked again when it was lost.

#include "tests/store/contract.h"

namespace lightkiln::test {
namespace {

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
  EXPECT_EQ(code_of([&] { load_chunks(*store, id); }), ErrorCode::internal);
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
  EXPECT_EQ(code_of([&] { load_chunks(*store, id); }), ErrorCode::internal);
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
  EXPECT_EQ(code_of([&] { load_chunks(*store, id); }), ErrorCode::internal);
  EXPECT_TRUE(store->rebake_lost_chunks(take()));
  chunk(take(), "one");
  const Claim whole = take();
  EXPECT_EQ(load_chunks(*store, id).size(), 2u);
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
    EXPECT_EQ(code_of([&] { load_chunks(*store, id); }), ErrorCode::internal);
    EXPECT_TRUE(store->rebake_lost_chunks(assembling));
  }
  EXPECT_EQ(job(id).state, JobState::failed);
  EXPECT_NE(job(id).error->detail.find("damaged"), std::string::npos);
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

}  // namespace
}  // namespace lightkiln::test
