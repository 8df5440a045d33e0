#pragma once

// The store: blobs, jobs, chunks, artifacts and events, with one state machine. What it
// acknowledges is durable. SqliteStore is the embedded home: one file and one directory.
//
// Who may do what: any process on this host may open the same directory. Every write transaction
// and every checkpoint holds an flock, so the WAL is never reset under a second writer. All calls
// are thread-safe; public functions lock, private twins assume the lock.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/store/records.h"
#include "server/store/refusal.h"

namespace lightkiln {

struct StoreOptions {
  std::string directory;
  int64_t lease_ms = 15000;
  int max_attempts = 2;                   // tries of one task before the job fails
  uint64_t min_free_bytes = 64ull << 20;  // below: StoreRefusal{kStorageFull}
  uint64_t max_queued = 10000;            // above: StoreRefusal{kQueueFull}
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
  // Those that are not there. The others count as used now, so that collect_unused() leaves them to
  // the client that was told not to send them.
  virtual std::vector<std::string> missing_blobs(const std::vector<std::string>& digests) = 0;
  // Opens a blob read-only and returns the descriptor (the caller closes it). Error{not_found}. The
  // first open in this process verifies the hash; a mismatch quarantines the blob: Error{internal}.
  virtual int open_blob(const std::string& digest, uint64_t* size) = 0;

  // --- jobs, for clients -------------------------------------------------------------------------
  virtual SubmitResult submit(const Submission& submission) = 0;
  virtual std::optional<JobRecord> find_job(const std::string& id) = 0;
  // Without spec_json, plan_json and accuracy_json, which can be large.
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
  // Gives all, by index, one at a time. Bytes that no longer match their digest are set aside:
  // Error{internal}; bytes that are absent: Error{not_found}.
  virtual void load_chunks(const std::string& job_id,
                           const std::function<void(StoredChunk)>& take) = 0;
  // For the claim of an assembly whose chunks did not load: those without bytes wait to be baked
  // again, and the job returns to that stage. A chunk lost once too often fails the job. False when
  // every chunk has its bytes or the lease is lost: nothing was changed.
  virtual bool rebake_lost_chunks(const Claim& claim) = 0;
  // What an assembly makes. Artifacts are written as they are added, and held only until then.
  class Result {
   public:
    virtual ~Result() = default;  // forgets what was added and not committed
    virtual void add(NewArtifact artifact) = 0;
    // Artifacts become visible and the job succeeds in one transaction.
    virtual void commit(const std::string& accuracy_json) = 0;
  };
  virtual std::unique_ptr<Result> begin_result(const Claim& claim) = 0;
  // A task that ended badly. `crashed` (signal, memory, time) is tried again until max_attempts;
  // anything else fails the job at once.
  virtual void fail_task(const Claim& claim, const JobError& error, bool crashed) = 0;
  // Gives the task back uncounted. `reason` becomes the job's: one sentence that says why nobody
  // works on it.
  virtual void release(const Claim& claim, const std::string& reason) = 0;
  // Blocks until there may be work or `wait_ms` passed. Wakes across processes.
  virtual void wait_for_work(int64_t wait_ms) = 0;

  // Removes blobs that no job refers to and that nobody sent, asked for or ordered with for
  // `unused_ms` of wall time (>= 0). Uploads under way are no blobs yet. It may be killed at any
  // moment; the next call goes on. `stop`, asked between files, ends it early; may be empty.
  virtual Collected collect_unused(int64_t unused_ms, const std::function<bool()>& stop) = 0;

  virtual StoreHealth health() = 0;
  virtual std::vector<WorkerRecord> workers() = 0;  // by name
  // Numbers for /metrics: jobs by "kind/state", gauges, and counters whose names end in "_total".
  virtual std::map<std::string, uint64_t> counts() = 0;
};

std::unique_ptr<Store> open_sqlite_store(const StoreOptions& options);

}  // namespace lightkiln
