#pragma once

// What the store keeps and hands out: jobs and their states, tasks, artifacts, events, workers.

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace lightkiln {

// queued -> running -> succeeded | failed | cancelled; queued -> cancelled. Terminal states never
// change, except that retry() makes a NEW attempt of a failed or cancelled job (back to queued).
enum class JobState { queued, running, succeeded, failed, cancelled };
enum class JobStage { plan, bake, assemble, done };
const char* job_state_name(JobState state);
const char* job_stage_name(JobStage stage);
bool is_terminal(JobState state);

struct JobError {
  std::string code;     // error_code_name, or "oven_crashed"
  std::string detail;   // one sentence for the client
  std::string pointer;  // into the input, or ""
};

struct JobRecord {
  std::string id;  // sortable by time of submission, 26 characters
  std::string name;
  std::string kind;
  std::string spec_json;    // canonical, fully defaulted
  std::string spec_digest;  // "sha256:..." of spec_json and the engine version
  std::map<std::string, std::string> labels;
  int priority = 0;        // larger is sooner
  bool plan_only = false;  // succeeds as soon as its plan is committed; bakes nothing
  JobState state = JobState::queued;
  JobStage stage = JobStage::plan;
  std::string
      reason;  // why it is not running or not done: one sentence, always filled while waiting
  uint64_t chunks_total = 0;
  uint64_t chunks_done = 0;
  double chunk_fraction = 0;  // of the chunk in hand, 0..1
  double current_error = 0;   // rms half-width over finished chunks; 0 = none yet
  double target_error = 0;
  double predicted_s = 0;
  bool from_cache = false;  // answered from an earlier job's artifacts
  int attempts = 0;         // tries that ended in a crash or an error
  std::optional<JobError> error;
  std::string plan_json;                                    // "" until planned
  std::string accuracy_json;                                // "" until finished
  int64_t created_ms = 0, started_ms = 0, finished_ms = 0;  // Unix time, display only; 0 = not yet
  uint64_t version = 0;  // rises with every visible change; the ETag
};

struct ArtifactRecord {
  std::string name, role, media_type, digest;
  uint64_t bytes = 0;
};

struct EventRecord {
  uint64_t sequence = 0;  // strictly rising over the whole store
  std::string job_id;
  std::string type;  // "state", "plan", "chunk", "progress", "artifact", "log"
  std::string json;  // payload object
  int64_t time_ms = 0;
};

struct Submission {
  std::string name, kind, spec_json, spec_digest;
  std::map<std::string, std::string> labels;
  std::vector<std::string>
      inputs;  // digests; all must be present: Error{not_found} names the missing
  int priority = 0;
  bool plan_only = false;
  double target_error = 0;
  std::string idempotency_key;  // "" = none
  std::string request_digest;   // of the whole request body, compared under an equal key
};
struct SubmitResult {
  std::string job_id;
  // An equal key and body was seen before. A job whose artifacts are no longer all there is not
  // answered with: the order is taken anew under the same key.
  bool replayed = false;
};

struct JobFilter {
  std::optional<JobState> state;
  std::string kind, text;  // "" = any; text matches id or name
  std::optional<std::pair<std::string, std::string>> label;
  std::string after;  // id of the last job of the page before; newest first
  int limit = 50;     // 1..500
};

enum class TaskType { plan, chunk, assemble };
struct Claim {
  std::string job_id;
  std::string spec_json;
  std::string plan_json;  // "" for TaskType::plan
  TaskType type = TaskType::plan;
  uint64_t chunk_index = 0;
  uint64_t lease = 0;  // fencing token: every commit with another one changes nothing
};

struct ChunkCommit {
  std::vector<std::byte> bytes;
  std::string report_json;  // ChunkReport
  // The report's last round, from which the job's current_error is summed.
  uint64_t elements = 0;
  double error_sum_sq = 0;
};

struct StoredChunk {
  std::vector<std::byte> bytes;
  std::string report_json;
};

struct NewArtifact {
  std::string name, role, media_type;
  std::vector<std::byte> bytes;
};

// A worker that is not known to have ended.
struct WorkerRecord {
  std::string name;
  std::vector<std::string> missing_layers;  // of its ovens' sandbox
};

struct Collected {
  uint64_t blobs = 0, bytes = 0;
};

struct StoreHealth {
  bool writable = false;
  std::string detail;  // what is wrong, "" when nothing
  uint64_t free_bytes = 0;
  uint64_t queued = 0, running = 0;
  uint64_t overdue = 0;  // leases expired for more than 30 s: nobody is rescuing them
};

}  // namespace lightkiln
