#pragma once

// The promises of server/store/store.h, held against the embedded store: what their tests share.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/store/store.h"
#include "tests/store/whole.h"
#include "tests/support/data.h"

namespace lightkiln::test {

inline std::vector<std::byte> bytes_of(const std::string& text) {
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
    commit_result(*store, claim,
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
      if (entry.is_regular_file()) write_file(entry.path(), bytes_of("rot!"));
  }
  size_t blob_files() {
    size_t count = 0;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(folder.path() / "store" / "blobs"))
      count += entry.is_regular_file() ? 1 : 0;
    return count;
  }

  TemporaryFolder folder;
  std::unique_ptr<Store> store;
};

}  // namespace lightkiln::test
