#pragma once

// Hands one claimed task to an oven and brings back what to commit.

#include <functional>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/worker/oven_process.h"

namespace lightkiln {

struct PlanAnswer {
  std::string plan_json;
  uint64_t chunks = 0;
  double predicted_s = 0;
};
// What an oven reported as the end of its job. `crashed` kinds are worth another try.
struct OvenFailure {
  JobError error;
  bool crashed = false;
};

struct FeedOptions {
  int threads = 0;
  uint64_t memory_bytes = 0;
  double chunk_seconds = 4.0;
};

using OnProgress = std::function<void(double fraction)>;

// Each call throws OvenFailure when the oven reports an error or a value that cannot be, PeerGone
// when it died, and Error{cancelled} when its channel was interrupted. feed_job also throws
// OvenFailure for an input that is damaged or gone.
void feed_job(OvenProcess& oven, Store& store, const Claim& claim, const FeedOptions& options,
              const OnProgress& on_progress);
PlanAnswer feed_plan(OvenProcess& oven, const OnProgress& on_progress);
void feed_known_plan(OvenProcess& oven, const std::string& plan_json);
ChunkCommit feed_chunk(OvenProcess& oven, uint64_t index, const OnProgress& on_progress);
void feed_stored_chunk(OvenProcess& oven, const StoredChunk& chunk);  // in order, before assembly
// Gives each artifact to `take` as it comes; returns the accuracy record.
std::string feed_assembly(OvenProcess& oven, const std::function<void(NewArtifact)>& take,
                          const OnProgress& on_progress);

}  // namespace lightkiln
