#pragma once

// The store: blobs, jobs, chunks, artifacts and events, with one state machine. What it
// acknowledges is durable. SqliteStore is the embedded home: one file and one directory.
//
// Who may do what: any process on this host may open the same directory. Every write transaction
// and every checkpoint holds an flock, so the WAL is never reset under a second writer. All calls
// are thread-safe; public functions lock, private twins assume the lock.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"

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

struct StoreHealth {
  bool writable = false;
  std::string detail;  // what is wrong, "" when nothing
  uint64_t free_bytes = 0;
  uint64_t queued = 0, running = 0;
  uint64_t overdue = 0;  // leases expired for more than 30 s: nobody is rescuing them
};

struct StoreOptions {
  std::string directory;
  int64_t lease_ms = 15000;
  int max_attempts = 2;                   // tries of one task before the job fails
  uint64_t min_free_bytes = 64ull << 20;  // below: uploads and submissions answer `unavailable`
  uint64_t max_queued = 10000;
};

class Store {
 public:
  virtual ~Store() = default;

  // --- blobs -------------------------------------------------------------------------------------
  // An upload in progress: bytes go to a temporary file while they are hashed.
  class Upload {
   public:
    virtual ~Upload() = default;
    virtual void append(const void* data, size_t size) = 0;
    // Makes the blob durable; throws Error{invalid_input} when the digest differs from `expected`.
    // Returns false when the blob was known already.
    virtual bool commit(const std::string& expected_digest) = 0;
  };
  virtual std::unique_ptr<Upload> begin_upload() = 0;
  // Stores bytes and returns their digest.
  virtual std::string put_blob(const std::vector<std::byte>& bytes) = 0;
  virtual bool has_blob(const std::string& digest) = 0;
  // Opens a blob read-only and returns the descriptor (the caller closes it). Error{not_found}. The
  // first open in this process verifies the hash; a mismatch quarantines the blob: Error{internal}.
  virtual int open_blob(const std::string& digest, uint64_t* size) = 0;

  // --- jobs, for clients -------------------------------------------------------------------------
  virtual SubmitResult submit(const Submission& submission) = 0;
  virtual std::optional<JobRecord> find_job(const std::string& id) = 0;
  // Without plan_json and accuracy_json, which can be large.
  virtual std::vector<JobRecord> list_jobs(const JobFilter& filter) = 0;
  virtual uint64_t
  list_version() = 0;  // rises with every visible change of any job: the list's ETag
  virtual void cancel(const std::string& id) = 0;  // Error{conflict} when terminal, {not_found}
  virtual void retry(const std::string& id) = 0;   // failed or cancelled; finished chunks are kept
  virtual void remove(const std::string& id) = 0;  // Error{conflict} while running
  virtual std::vector<ArtifactRecord> artifacts(const std::string& id) = 0;
  virtual std::vector<EventRecord> events(const std::string& job_id, uint64_t after, int limit) = 0;
  virtual std::vector<std::string> chunk_reports(const std::string& id) = 0;  // finished, by index
  // Blocks until the job's version exceeds `version`, it is terminal, or `wait_ms` passed.
  virtual std::optional<JobRecord> wait_job(const std::string& id, uint64_t version,
                                            int64_t wait_ms) = 0;

  // --- tasks, for workers ------------------------------------------------------------------------
  // Makes a worker known to workers(); claim() enlists those that did not.
  virtual void enlist(const std::string& worker,
                      const std::vector<std::string>& missing_layers) = 0;
  // The next task: by priority, then age, then chunk index. Among jobs of equal priority
  // `prefer_job` is taken first when it has work, so that an oven keeps its scene. A task whose
  // lease expired is claimable again. Error{unavailable} when the store cannot be written.
  virtual std::optional<Claim> claim(const std::string& worker, const std::string& prefer_job) = 0;
  // Extends the lease. Returns false when it is lost or the job is cancelled: stop at once.
  virtual bool heartbeat(const Claim& claim, double fraction) = 0;
  // What heartbeat() would answer, by reading alone: cheap enough to ask ten times a second.
  virtual bool holds_lease(const Claim& claim) = 0;
  virtual void commit_plan(const Claim& claim, const std::string& plan_json, uint64_t chunks,
                           double predicted_s) = 0;
  virtual void commit_chunk(const Claim& claim, const ChunkCommit& chunk) = 0;
  // All, by index. Bytes that no longer match their digest are set aside: Error{internal}; bytes
  // that are absent: Error{not_found}.
  virtual std::vector<StoredChunk> load_chunks(const std::string& job_id) = 0;
  // For the claim of an assembly whose chunks did not load: those without bytes wait to be baked
  // again, and the job returns to that stage. A chunk lost once too often fails the job. False when
  // every chunk has its bytes or the lease is lost: nothing was changed.
  virtual bool rebake_lost_chunks(const Claim& claim) = 0;
  // Artifacts become visible and the job succeeds in one transaction.
  virtual void commit_result(const Claim& claim, const std::vector<NewArtifact>& artifacts,
                             const std::string& accuracy_json) = 0;
  // A task that ended badly. `crashed` (signal, memory, time) is tried again until max_attempts;
  // anything else fails the job at once.
  virtual void fail_task(const Claim& claim, const JobError& error, bool crashed) = 0;
  // Gives the task back uncounted. `reason` becomes the job's: one sentence that says why nobody
  // works on it.
  virtual void release(const Claim& claim, const std::string& reason) = 0;
  // Blocks until there may be work or `wait_ms` passed. Wakes across processes.
  virtual void wait_for_work(int64_t wait_ms) = 0;

  virtual StoreHealth health() = 0;
  virtual std::vector<WorkerRecord> workers() = 0;  // by name
  // Counters for /metrics: jobs by (kind, state) and totals.
  virtual std::map<std::string, uint64_t> counts() = 0;
};

std::unique_ptr<Store> open_sqlite_store(const StoreOptions& options);

}  // namespace lightkiln
