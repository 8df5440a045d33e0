#include "server/store/database.h"

#include <utility>

#include <sqlite3.h>

#include "server/store/refusal.h"
#include "server/store/storage_failure.h"

namespace lightkiln {

namespace {

[[noreturn]] void fail(sqlite3* db, const std::string& doing) {
  const int extended = sqlite3_extended_errcode(db);
  const std::string text = doing + ": " + sqlite3_errmsg(db);
  if (extended == SQLITE_IOERR_FSYNC || extended == SQLITE_IOERR_DIR_FSYNC)
    stop_for_storage_failure("the database: " + text);
  switch (extended & 0xff) {
    case SQLITE_BUSY:
      throw Error(ErrorCode::unavailable, "The store is busy; try again.");
    case SQLITE_FULL:
      throw StoreRefusal(kStorageFull, "The disk of the store is full.");
    case SQLITE_NOMEM:
      throw Error(ErrorCode::out_of_memory, "The store ran out of memory.");
    default:
      throw Error(ErrorCode::internal, "The database failed while " + text + ".");
  }
}

void check(sqlite3* db, int code, const char* doing) {
  if (code != SQLITE_OK) fail(db, doing);
}

}  // namespace

Statement::~Statement() {
  if (!statement_) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

Statement::Statement(Statement&& other) noexcept
    : db_(other.db_), statement_(std::exchange(other.statement_, nullptr)) {}

void Statement::bind(int index, std::string_view value) {
  check(db_,
        sqlite3_bind_text64(statement_, index, value.data() ? value.data() : "", value.size(),
                            SQLITE_TRANSIENT, SQLITE_UTF8),
        "binding text");
}
void Statement::bind(int index, int64_t value) {
  check(db_, sqlite3_bind_int64(statement_, index, value), "binding a number");
}
void Statement::bind(int index, double value) {
  check(db_, sqlite3_bind_double(statement_, index, value), "binding a number");
}

bool Statement::step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  fail(db_, std::string("running \"") + sqlite3_sql(statement_) + "\"");
}

std::string Statement::text(int column) const {
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (!bytes) return {};
  return {bytes, static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}
int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}
double Statement::real(int column) const {
  return sqlite3_column_double(statement_, column);
}

Database::Database(const std::string& path, Access access) {
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE |
                    (access == Access::write ? SQLITE_OPEN_CREATE : 0);
  if (sqlite3_open_v2(path.c_str(), &db_, flags, nullptr) != SQLITE_OK) {
    const std::string text = db_ ? sqlite3_errmsg(db_) : "out of memory";
    sqlite3_close(db_);
    throw Error(ErrorCode::unavailable, "The store's database cannot be opened: " + text + ".");
  }
  try {
    sqlite3_busy_timeout(db_, 5000);
    sqlite3_db_config(db_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    sqlite3_db_config(db_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(db_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(db_, SQLITE_DBCONFIG_ENABLE_FKEY, 1, nullptr);
    execute(
        "PRAGMA mmap_size=0; PRAGMA cell_size_check=ON; PRAGMA synchronous=FULL;"
        "PRAGMA temp_store=MEMORY;");
    if (access == Access::write) execute("PRAGMA journal_mode=WAL;");
    // The hook replaces SQLite's own automatic checkpoint, which would run outside the lock.
    sqlite3_wal_hook(
        db_,
        [](void* self, sqlite3*, const char*, int pages) {
          static_cast<Database*>(self)->wal_pages_ = pages;
          return SQLITE_OK;
        },
        this);
    if (access == Access::read) execute("PRAGMA query_only=ON;");
  } catch (...) {
    sqlite3_close(db_);
    throw;
  }
}

Database::~Database() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
  sqlite3_close(db_);
}

Statement Database::prepare(const char* sql) {
  sqlite3_stmt*& statement = statements_[sql];
  if (!statement)
    check(db_, sqlite3_prepare_v3(db_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr),
          sql);
  return {db_, statement};
}

void Database::execute(const char* sql) {
  check(db_, sqlite3_exec(db_, sql, nullptr, nullptr, nullptr), sql);
}
int64_t Database::changes() const {
  return sqlite3_changes64(db_);
}
bool Database::in_transaction() const {
  return sqlite3_get_autocommit(db_) == 0;
}

void Database::checkpoint() {
  const int code =
      sqlite3_wal_checkpoint_v2(db_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
  // Busy only means that a reader still needs the log; the next one gets further.
  if (code != SQLITE_OK && (code & 0xff) != SQLITE_BUSY && (code & 0xff) != SQLITE_LOCKED)
    fail(db_, "moving the log into the database");
}

Transaction::Transaction(Database& db, bool sync) : db_(db) {
  db_.execute(sync ? "PRAGMA synchronous=FULL; BEGIN IMMEDIATE"
                   : "PRAGMA synchronous=NORMAL; BEGIN IMMEDIATE");
}
Transaction::~Transaction() {
  if (!db_.in_transaction()) return;
  try {
    db_.execute("ROLLBACK");
  } catch (const std::exception&) {
    // SQLite has rolled back by itself after an error that ended the transaction.
  }
}
void Transaction::commit() {
  db_.execute("COMMIT");
}

}  // namespace lightkiln
