// Bytes that nobody needs go, bytes that somebody needs stay, however it is interrupted.

#include <csignal>
#include <filesystem>
#include <map>
#include <random>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "server/store/database.h"
#include "server/store/store.h"
#include "tests/store/whole.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kDayMs = 24ll * 3600 * 1000;
constexpr int64_t kWeekMs = 7 * kDayMs;

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

class Collect : public testing::Test {
 protected:
  Collect() : store(open()) {}

  std::unique_ptr<Store> open() const {
    StoreOptions options;
    options.directory = directory();
    options.min_free_bytes = 0;
    return open_sqlite_store(options);
  }
  std::string directory() const { return (folder.path() / "store").string(); }
  std::string put(const std::string& text) { return store->put_blob(bytes_of(text)); }
  std::string submit(const std::vector<std::string>& inputs) {
    Submission order;
    order.kind = "ambient_occlusion";
    order.spec_json = "{}";
    order.spec_digest = "spec " + std::to_string(++orders_);
    order.inputs = inputs;
    return store->submit(order).job_id;
  }
  uint64_t collect(int64_t unused_ms = kWeekMs) {
    return store->collect_unused(unused_ms, {}).blobs;
  }
  std::string path_of(const std::string& digest) const {
    return directory() + "/blobs/" + digest.substr(7, 2) + "/" + digest.substr(7);
  }

  // The file's age and, unless `file_only`, that of its use.
  void make_older(const std::string& digest, int64_t by_ms, bool file_only = false) {
    struct stat info {};
    ASSERT_EQ(stat(path_of(digest).c_str(), &info), 0);
    timespec times[2] = {info.st_atim, info.st_mtim};
    times[1].tv_sec -= by_ms / 1000;
    ASSERT_EQ(utimensat(AT_FDCWD, path_of(digest).c_str(), times, 0), 0);
    if (file_only) return;
    Database db(directory() + "/store.sqlite", Database::Access::write);
    db.run("UPDATE uploads SET used_ms=used_ms-?2 WHERE digest=?1", digest, by_ms);
  }

  test::TemporaryFolder folder;
  std::unique_ptr<Store> store;

 private:
  int orders_ = 0;
};

TEST_F(Collect, AnUploadGoesOnceItIsOldAndNotBefore) {
  const std::string digest = put("an upload");
  make_older(digest, kWeekMs - 60'000);
  EXPECT_EQ(collect(), 0u);
  EXPECT_TRUE(store->has_blob(digest));
  make_older(digest, 120'000);
  const Collected collected = store->collect_unused(kWeekMs, {});
  EXPECT_EQ(collected.blobs, 1u);
  EXPECT_EQ(collected.bytes, 9u);
  EXPECT_FALSE(store->has_blob(digest));
  EXPECT_EQ(store->counts().at("collected_blobs_total"), 1u);
  EXPECT_EQ(store->counts().at("collected_bytes_total"), 9u);
  EXPECT_EQ(collect(), 0u);
  EXPECT_EQ(put("an upload"), digest) << "and it can come again";
  EXPECT_TRUE(store->has_blob(digest));
}

TEST_F(Collect, WhatAJobRefersToStaysHoweverOld) {
  const std::string input = put("input");
  const std::string id = submit({input});
  store->commit_plan(*store->claim("w", ""), "{}", 1, 1);
  store->commit_chunk(*store->claim("w", ""), {bytes_of("chunk"), "{}"});
  const std::string chunk = put("chunk");  // the name of the chunk's bytes
  for (const std::string& digest : {input, chunk}) make_older(digest, 100 * kWeekMs);
  EXPECT_EQ(collect(), 0u);
  EXPECT_EQ(test::load_chunks(*store, id).size(), 1u);
  test::commit_result(*store, *store->claim("w", ""), {{"a", "image", "x/y", bytes_of("artifact")}},
                      "{}");
  const std::string artifact = store->artifacts(id).at(0).digest;
  make_older(artifact, 100 * kWeekMs, true);
  make_older(chunk, 0);
  EXPECT_EQ(collect(), 1u) << "the chunk, uploaded long ago and not referred to any more";
  EXPECT_FALSE(store->has_blob(chunk));
  EXPECT_TRUE(store->has_blob(input));
  EXPECT_TRUE(store->has_blob(artifact));
}

TEST_F(Collect, TheAgeCountsFromTheLastUse) {
  const std::string sent = put("sent"), asked = put("asked"), forgotten = put("forgotten");
  const std::string id = submit({forgotten});
  for (const std::string& digest : {sent, asked, forgotten}) make_older(digest, 2 * kWeekMs);
  put("sent");
  EXPECT_EQ(store->missing_blobs({asked, "sha256:" + std::string(64, '0')}),
            std::vector<std::string>{"sha256:" + std::string(64, '0')});
  store->cancel(id);
  store->remove(id);
  EXPECT_EQ(collect(), 0u) << "sent again, asked for, just now not ordered any more";
  for (const std::string& digest : {sent, asked, forgotten}) make_older(digest, 2 * kWeekMs);
  EXPECT_EQ(collect(), 3u);
}

TEST_F(Collect, AnUploadUnderWayIsNoBlobYet) {
  auto upload = store->begin_upload();
  upload->append("half", 4);
  EXPECT_EQ(collect(0), 0u);
  upload->append(" and half", 9);
  const std::string digest = put("half and half");
  usleep(3000);
  EXPECT_EQ(collect(0), 1u) << "the control: with the age 0 a whole one goes";
  EXPECT_TRUE(upload->commit(digest));
  EXPECT_TRUE(store->has_blob(digest));
}

TEST_F(Collect, FilesThatNobodyEverReferredToGoByTheirOwnAge) {
  const std::string digest = put("left by a crash");
  {
    Database db(directory() + "/store.sqlite", Database::Access::write);
    db.run("DELETE FROM uploads");
  }
  EXPECT_EQ(collect(), 0u) << "it may be about to be referred to";
  make_older(digest, 2 * kWeekMs, true);
  EXPECT_EQ(collect(), 1u);
}

TEST_F(Collect, StopsWhenAsked) {
  put("x");
  usleep(3000);
  EXPECT_EQ(store->collect_unused(0, [] { return true; }).blobs, 0u);
  EXPECT_EQ(collect(0), 1u);
}

// A collector that takes everything unused at once, killed again and again, beside a client that
// uploads and orders: no order that was accepted ever lacks an input.
TEST_F(Collect, KillNineInTheMiddleTakesNothingThatIsNeeded) {
  std::mt19937 random(29);
  std::map<std::string, std::string> inputs;  // of accepted orders
  int refused = 0, number = 0;
  for (int round = 0; round < 12; ++round) {
    for (int i = 0; i < 40; ++i) put("unused " + std::to_string(++number));
    const pid_t collector = fork();
    if (collector == 0) {
      const auto own = open();
      for (;;) own->collect_unused(0, {});
    }
    const double end_s = wall_seconds() + 0.02 + 1e-3 * static_cast<double>(random() % 60);
    while (wall_seconds() < end_s) {
      try {
        const std::string text = "needed " + std::to_string(++number);
        const std::string digest = put(text);
        submit({digest});
        inputs[digest] = text;
      } catch (const Error& error) {
        // The collector was faster; the client is told, and sends it again.
        EXPECT_TRUE(error.code() == ErrorCode::not_found || error.code() == ErrorCode::unavailable)
            << error.what();
        ++refused;
      }
    }
    kill(collector, SIGKILL);
    waitpid(collector, nullptr, 0);
  }
  store = open();
  usleep(3000);
  collect(0);
  EXPECT_GT(inputs.size(), 12u);
  for (const auto& [digest, text] : inputs) {
    uint64_t size = 0;
    close(store->open_blob(digest, &size));
    EXPECT_EQ(size, text.size());
  }
  size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(directory() + "/blobs"))
    files += entry.is_regular_file() ? 1 : 0;
  EXPECT_EQ(files, inputs.size()) << "everything else is gone";
  Database db(directory() + "/store.sqlite", Database::Access::read);
  EXPECT_EQ(static_cast<size_t>(db.number(0, "SELECT count(*) FROM uploads")), inputs.size());
  RecordProperty("refused", refused);
}

}  // namespace
}  // namespace lightkiln
