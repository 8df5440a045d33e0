#include "server/store/sqlite_store.h"

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <thread>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include "server/store/process_identity.h"
#include "server/store/schema.h"

namespace lightkiln {

namespace {

// The log is moved home when it holds this many pages (4 KiB each).
constexpr int kCheckpointPages = 1000;
constexpr auto kLockPause = std::chrono::microseconds(250);
constexpr int kLockTries = 20'000;  // 5 s
constexpr size_t kIdleReaders = 8;

std::string prepared_folder(const StoreOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.directory, error);
  if (error)
    throw Error(ErrorCode::unavailable, "The store folder '" + options.directory +
                                            "' cannot be made: " + error.message() + ".");
  return options.directory;
}

uint64_t free_bytes_of(const std::string& directory) {
  struct statvfs info {};
  if (statvfs(directory.c_str(), &info) != 0) return 0;
  return static_cast<uint64_t>(info.f_bavail) * info.f_frsize;
}

int64_t milliseconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<int64_t>(now.tv_sec) * 1000 + now.tv_nsec / 1'000'000;
}

}  // namespace

int64_t lease_clock_ms() {
  return milliseconds(CLOCK_BOOTTIME);
}
int64_t wall_clock_ms() {
  return milliseconds(CLOCK_REALTIME);
}

SqliteStore::SqliteStore(const StoreOptions& options)
    : options_(options),
      blobs_(prepared_folder(options) + "/blobs"),
      wake_(options.directory + "/wake"),
      own_identity_(own_process_identity()) {
  lock_.reset(open((options_.directory + "/lock").c_str(),
                   O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!lock_)
    throw Error(ErrorCode::unavailable,
                "The store's lock file in '" + options_.directory + "' cannot be opened.");
  const FileLock lock(lock_.get());
  writer_ =
      std::make_unique<Database>(options_.directory + "/store.sqlite", Database::Access::write);
  migrate(*writer_);
  check_integrity(*writer_);
  {
    // Leases of an earlier boot were counted on another clock, and their holders are gone.
    Transaction transaction(*writer_);
    const std::string boot = boot_identity();
    if (writer_->number(0, "SELECT count(*) FROM texts WHERE name='boot' AND value=?1", boot) ==
        0) {
      writer_->run("UPDATE tasks SET state=0, worker='', lease=0 WHERE state=1");
      writer_->run("DELETE FROM workers");
      writer_->run("INSERT INTO texts VALUES('boot',?1) ON CONFLICT(name) DO UPDATE SET value=?1",
                   boot);
    }
    transaction.commit();
  }
  writer_->checkpoint();
}

SqliteStore::~SqliteStore() = default;

SqliteStore::FileLock::FileLock(int fd) : fd_(fd) {
  for (int tries = 0; flock(fd_, LOCK_EX | LOCK_NB) != 0; ++tries) {
    if ((errno != EWOULDBLOCK && errno != EINTR) || tries >= kLockTries)
      throw Error(ErrorCode::unavailable, "The store is busy; try again.");
    std::this_thread::sleep_for(kLockPause);
  }
}
SqliteStore::FileLock::~FileLock() {
  flock(fd_, LOCK_UN);
}

SqliteStore::Writer::Writer(SqliteStore& store, Durability durability)
    : store_(store),
      mutex_(store.write_mutex_),
      file_lock_(store.lock_.get()),
      transaction_(*store.writer_, durability == Durability::at_once) {}
SqliteStore::Writer::~Writer() = default;

void SqliteStore::Writer::commit() {
  transaction_.commit();
  if (db().wal_pages() >= kCheckpointPages) db().checkpoint();
  store_.wake_.wake_all();
}

SqliteStore::ReadAccess::ReadAccess(SqliteStore& store) : store_(store) {
  {
    const std::lock_guard lock(store_.readers_mutex_);
    if (!store_.readers_.empty()) {
      db_ = std::move(store_.readers_.back());
      store_.readers_.pop_back();
    }
  }
  if (!db_)
    db_ = std::make_unique<Database>(store_.options_.directory + "/store.sqlite",
                                     Database::Access::read);
  db_->run("BEGIN");
}
SqliteStore::ReadAccess::~ReadAccess() {
  try {
    db_->run("COMMIT");
  } catch (const Error&) {
    return;  // a connection that cannot end its snapshot is closed rather than lent again
  }
  const std::lock_guard lock(store_.readers_mutex_);
  if (store_.readers_.size() < kIdleReaders) store_.readers_.push_back(std::move(db_));
}

void SqliteStore::require_space() const {
  if (free_bytes_of(options_.directory) < options_.min_free_bytes)
    throw StoreRefusal(kStorageFull, "The disk of the store is almost full.");
}

// --- blobs ---------------------------------------------------------------------------------------

namespace {

class BlobUpload final : public Store::Upload {
 public:
  explicit BlobUpload(SqliteStore& store) : store_(store), draft_(store.blobs()) {}

  void append(const void* data, size_t size) override { draft_.append(data, size); }

  bool commit(const std::string& expected_digest) override {
    const std::string digest = draft_.finish();
    if (digest != expected_digest)
      throw Error(ErrorCode::invalid_input, "The bytes sent have the digest " + digest + ", not " +
                                                expected_digest + " as announced.");
    const bool fresh = draft_.keep();
    store_.keep_upload(digest);
    return fresh;
  }

 private:
  SqliteStore& store_;
  Blobs::Draft draft_;
};

}  // namespace

std::unique_ptr<Store::Upload> SqliteStore::begin_upload() {
  require_space();
  return std::make_unique<BlobUpload>(*this);
}

std::string SqliteStore::put_blob(const std::vector<std::byte>& bytes) {
  require_space();
  std::string digest = blobs_.put(bytes);
  keep_upload(digest);
  return digest;
}

void SqliteStore::keep_upload(const std::string& digest) {
  Writer writer(*this);
  if (!blobs_.has(digest))
    throw Error(ErrorCode::unavailable, "The blob was removed while it arrived; send it again.");
  writer.db().run(
      "INSERT INTO uploads(digest,used_ms) VALUES(?1,?2) ON CONFLICT(digest) DO UPDATE SET "
      "used_ms=?2",
      digest, wall_clock_ms());
  writer.commit();
}

bool SqliteStore::has_blob(const std::string& digest) {
  return blobs_.has(digest);
}

int SqliteStore::open_blob(const std::string& digest, uint64_t* size) {
  return blobs_.open(digest, size);
}

// --- health --------------------------------------------------------------------------------------

StoreHealth SqliteStore::health() {
  StoreHealth health;
  health.free_bytes = free_bytes_of(options_.directory);
  try {
    ReadAccess read(*this);
    Database& db = read.db();
    health.queued = static_cast<uint64_t>(db.number(0, "SELECT count(*) FROM jobs WHERE state=?1",
                                                    static_cast<int>(JobState::queued)));
    health.running = static_cast<uint64_t>(db.number(0, "SELECT count(*) FROM jobs WHERE state=?1",
                                                     static_cast<int>(JobState::running)));
    health.overdue = static_cast<uint64_t>(
        db.number(0, "SELECT count(*) FROM tasks WHERE state=1 AND lease_until_ms<?1",
                  lease_clock_ms() - 30'000));
    require_space();
    Writer probe(*this);  // takes the locks and the write right, and changes nothing
    health.writable = true;
  } catch (const Error& error) {
    health.detail = error.what();
  }
  if (health.writable && health.overdue > 0)
    health.detail = std::to_string(health.overdue) + " tasks are overdue and no worker takes them.";
  return health;
}

std::map<std::string, uint64_t> SqliteStore::counts() {
  std::map<std::string, uint64_t> counts;
  ReadAccess read(*this);
  Statement rows = read.db().query("SELECT kind, state, count(*) FROM jobs GROUP BY kind, state");
  while (rows.step())
    counts[rows.text(0) + "/" + job_state_name(static_cast<JobState>(rows.integer(1)))] =
        rows.natural(2);
  counts["events_total"] =
      static_cast<uint64_t>(read.db().number(0, "SELECT coalesce(max(sequence),0) FROM events"));
  counts["collected_blobs_total"] = static_cast<uint64_t>(
      read.db().number(0, "SELECT value FROM counters WHERE name='collected_blobs'"));
  counts["collected_bytes_total"] = static_cast<uint64_t>(
      read.db().number(0, "SELECT value FROM counters WHERE name='collected_bytes'"));
  counts["leased_tasks"] =
      static_cast<uint64_t>(read.db().number(0, "SELECT count(*) FROM tasks WHERE state=1"));
  return counts;
}

std::unique_ptr<Store> open_sqlite_store(const StoreOptions& options) {
  return std::make_unique<SqliteStore>(options);
}

}  // namespace lightkiln
