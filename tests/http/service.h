#pragma once

// The API over a real socket and a real store, without workers: tests play the worker.

#include <memory>
#include <string>
#include <vector>

#include "proto/messages.h"
#include "server/http/api.h"
#include "server/http/fence.h"
#include "server/store/store.h"
#include "tests/support/data.h"

namespace lightkiln::test {

class Service {
 public:
  explicit Service(FenceLimits limits = roomy(), ApiOptions options = {}, StoreOptions kept = {});
  ~Service();

  // Limits of connections that a test from one address does not meet.
  static FenceLimits roomy();

  // Uploads bytes and gives their digest.
  std::string upload(const std::string& bytes);
  // The body of an ambient-occlusion order for a blob.
  static std::string order(const std::string& digest, const std::string& name = "");
  // Orders one and gives its id.
  std::string submit();
  // Plays the worker until nothing is to be done: each job gets two chunks and two artifacts.
  void work();
  // The first task only.
  Claim take();

  TemporaryFolder folder;
  Log log;
  std::unique_ptr<Store> store;
  Api api;
  Fence fence;
  int port = 0;
};

// The bytes of the artifact that Service::work makes, 0, 1, 2, … 251, 0, …
inline constexpr size_t kArtifactBytes = 1000;
std::string artifact_bytes();

std::vector<std::byte> to_bytes(const std::string& text);

}  // namespace lightkiln::test
