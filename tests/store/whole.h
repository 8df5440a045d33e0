#pragma once

// Results and chunks all at once, for tests that have few and small ones.

#include <utility>
#include <vector>

#include "server/store/store.h"

namespace lightkiln::test {

inline void commit_result(Store& store, const Claim& claim, std::vector<NewArtifact> artifacts,
                          const std::string& accuracy_json) {
  const auto result = store.begin_result(claim);
  for (NewArtifact& artifact : artifacts) result->add(std::move(artifact));
  result->commit(accuracy_json);
}

inline std::vector<StoredChunk> load_chunks(Store& store, const std::string& job_id) {
  std::vector<StoredChunk> chunks;
  store.load_chunks(job_id, [&](StoredChunk chunk) { chunks.push_back(std::move(chunk)); });
  return chunks;
}

}  // namespace lightkiln::test
