#pragma once

// The embedded store. Internal to this room: everyone else includes store.h.
//
// One connection of this process writes, under a mutex and an flock on <directory>/lock, and is the
// only one that ever checkpoints; readers borrow connections of their own. Every change appends its
// events and raises the versions in the transaction that makes it, and wakes whoever waits after
// it.

#include <mutex>
#include <set>

#include "core/base/descriptor.h"
#include "server/store/blobs.h"
#include "server/store/database.h"
#include "server/store/job_state.h"
#include "server/store/store.h"
#include "server/store/wake.h"

namespace lightkiln {

// Why a job that nobody works on does not move.
inline constexpr const char* kWaitingForWorker = "Waiting for a worker.";

// Milliseconds since boot, suspends included: the only clock that judges leases.
int64_t lease_clock_ms();
// Unix milliseconds, for display and for naming jobs.
int64_t wall_clock_ms();

class SqliteStore final : public Store {
 public:
  explicit SqliteStore(const StoreOptions& options);
  ~SqliteStore() override;

  std::unique_ptr<Upload> begin_upload() override;
  std::string put_blob(const std::vector<std::byte>& bytes) override;
  bool has_blob(const std::string& digest) override;
  std::vector<std::string> missing_blobs(const std::vector<std::string>& digests) override;
  int open_blob(const std::string& digest, uint64_t* size) override;

  SubmitResult submit(const Submission& submission) override;
  std::optional<JobRecord> find_job(const std::string& id) override;
  std::vector<JobRecord> list_jobs(const JobFilter& filter) override;
  uint64_t list_version() override;
  void cancel(const std::string& id) override;
  void retry(const std::string& id) override;
  void remove(const std::string& id) override;
  std::vector<ArtifactRecord> artifacts(const std::string& id) override;
  std::vector<EventRecord> events(const std::string& job_id, uint64_t after, int limit) override;
  std::vector<std::string> chunk_reports(const std::string& id) override;
  std::optional<JobRecord> wait_job(const std::string& id, uint64_t version,
                                    int64_t wait_ms) override;

  void enlist(const std::string& worker, const std::vector<std::string>& missing_layers) override;
  std::optional<Claim> claim(const std::string& worker, const std::string& prefer_job) override;
  bool heartbeat(const Claim& claim, double fraction) override;
  bool holds_lease(const Claim& claim) override;
  void commit_plan(const Claim& claim, const std::string& plan_json, uint64_t chunks,
                   double predicted_s) override;
  void commit_chunk(const Claim& claim, const ChunkCommit& chunk) override;
  void load_chunks(const std::string& job_id,
                   const std::function<void(StoredChunk)>& take) override;
  bool rebake_lost_chunks(const Claim& claim) override;
  std::unique_ptr<Result> begin_result(const Claim& claim) override;
  void fail_task(const Claim& claim, const JobError& error, bool crashed) override;
  void release(const Claim& claim, const std::string& reason) override;
  void wait_for_work(int64_t wait_ms) override;

  Collected collect_unused(int64_t unused_ms, const std::function<bool()>& stop) override;

  StoreHealth health() override;
  std::vector<WorkerRecord> workers() override;
  std::map<std::string, uint64_t> counts() override;

  // Remembers that a client sent these bytes, so that removing a job does not take them away.
  void keep_upload(const std::string& digest);
  // The end of a Result. False when the lease is lost: nothing was changed.
  bool commit_artifacts(const Claim& claim, const std::vector<ArtifactRecord>& artifacts,
                        const std::string& accuracy_json);
  // Removes those that no job refers to and no client sent.
  void forget(const std::vector<ArtifactRecord>& artifacts);
  Blobs& blobs() { return blobs_; }
  // Throws StoreRefusal{kStorageFull} below the floor of free space.
  void require_space() const;

 private:
  class FileLock;    // the flock
  class Writer;      // mutex, flock and transaction in one
  class ReadAccess;  // a borrowed read connection

  // The twins below assume an open Writer.
  uint64_t raise_version(Database& db);
  void touch(Database& db, const std::string& id);
  void add_event(Database& db, const std::string& id, const char* type, const std::string& json);
  JobPosition position(Database& db, const std::string& id);  // Error{not_found}
  void move_job(Database& db, const std::string& id, JobEvent event, const std::string& reason);
  void fail_job(Database& db, const std::string& id, const JobError& error);
  void sum_chunks(Database& db, const std::string& id);  // done, error: from the tasks
  void drop_leases(Database& db, const std::string& id);
  bool holds(Database& db, const Claim& claim);
  void expire_dead_workers(Database& db);
  std::optional<std::string> replay(Database& db, const Submission& submission);
  bool has_artifacts(Database& db, const std::string& id);  // every one's bytes are there
  std::vector<uint64_t> lost_chunks(Database& db, const std::string& id);
  void bake_again(Database& db, const std::string& id, const std::vector<uint64_t>& chunks);
  bool answer_from_cache(Database& db, const std::string& id, const Submission& submission);
  void drop_chunk_bytes(Database& db, const std::string& id, std::vector<std::string>* orphans);
  void touch_inputs(Database& db, const std::string& id);
  void remove_orphans(Database& db, const std::vector<std::string>& digests);
  bool is_referred_to(Database& db, const std::string& digest);  // by a job; uploads do not count
  bool was_used_since(Database& db, const std::string& digest, int64_t used_ms);  // by a client
  void register_worker(Database& db, const std::string& worker, const std::string& missing);
  bool lose_lease(Database& db, const Claim& claim, int losses);

  JobRecord read_job(Database& db, const Statement& row, bool documents);
  std::optional<JobRecord> read_job(Database& db, const std::string& id);
  bool maybe_work(Database& db);

  StoreOptions options_;
  Descriptor lock_;
  Blobs blobs_;
  WakeFile wake_;
  std::string own_identity_;
  std::mutex write_mutex_;
  std::unique_ptr<Database> writer_;
  std::mutex readers_mutex_;
  std::vector<std::unique_ptr<Database>> readers_;
  std::set<std::string> own_workers_;  // registered by this process; under write_mutex_
};

class SqliteStore::FileLock {
 public:
  explicit FileLock(int fd);  // Error{unavailable} when it is not free within 5 s
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int fd_;
};

// Whether a commit reaches the disk before it returns. Leases need not: after a power loss no
// worker holds one, and a killed process loses nothing that the kernel has.
enum class Durability { at_once, with_the_next };

// The right to write: in-process mutex, flock, BEGIN IMMEDIATE.
class SqliteStore::Writer {
 public:
  explicit Writer(SqliteStore& store, Durability durability = Durability::at_once);
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  Database& db() { return *store_.writer_; }
  // Makes the transaction durable, moves a large log home, wakes the waiting.
  void commit();

 private:
  SqliteStore& store_;
  std::lock_guard<std::mutex> mutex_;
  FileLock file_lock_;
  Transaction transaction_;
};

// Everything read through one of these is one snapshot.
class SqliteStore::ReadAccess {
 public:
  explicit ReadAccess(SqliteStore& store);
  ~ReadAccess();
  ReadAccess(const ReadAccess&) = delete;
  ReadAccess& operator=(const ReadAccess&) = delete;
  Database& db() { return *db_; }

 private:
  SqliteStore& store_;
  std::unique_ptr<Database> db_;
};

}  // namespace lightkiln
