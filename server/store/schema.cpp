#include "server/store/schema.h"

#include <string>

#include "core/base/error.h"

namespace lightkiln {

namespace {

// Texts that can be large live in `documents`, so that a heartbeat never rewrites them.
constexpr const char* kMigrations[] = {
    R"sql(
CREATE TABLE counters(name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO counters VALUES ('version', 0), ('lease', 0);
CREATE TABLE texts(name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;

CREATE TABLE jobs(
  id TEXT PRIMARY KEY, name TEXT NOT NULL, kind TEXT NOT NULL, spec_digest TEXT NOT NULL,
  priority INTEGER NOT NULL, plan_only INTEGER NOT NULL,
  state INTEGER NOT NULL, stage INTEGER NOT NULL, reason TEXT NOT NULL,
  chunks_total INTEGER NOT NULL DEFAULT 0, chunks_done INTEGER NOT NULL DEFAULT 0,
  chunk_fraction REAL NOT NULL DEFAULT 0, error_sum_sq REAL NOT NULL DEFAULT 0,
  error_elements INTEGER NOT NULL DEFAULT 0, target_error REAL NOT NULL,
  predicted_s REAL NOT NULL DEFAULT 0, from_cache INTEGER NOT NULL DEFAULT 0,
  attempts INTEGER NOT NULL DEFAULT 0, error_code TEXT NOT NULL DEFAULT '',
  error_detail TEXT NOT NULL DEFAULT '', error_pointer TEXT NOT NULL DEFAULT '',
  created_ms INTEGER NOT NULL, started_ms INTEGER NOT NULL DEFAULT 0,
  finished_ms INTEGER NOT NULL DEFAULT 0, version INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX active_jobs ON jobs(priority DESC, id) WHERE state < 2;
CREATE INDEX jobs_by_state ON jobs(state, kind);
CREATE INDEX jobs_by_digest ON jobs(spec_digest, state);

CREATE TABLE documents(
  job_id TEXT PRIMARY KEY REFERENCES jobs(id) ON DELETE CASCADE,
  spec_json TEXT NOT NULL, plan_json TEXT NOT NULL DEFAULT '',
  accuracy_json TEXT NOT NULL DEFAULT '');

CREATE TABLE labels(
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  key TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY(job_id, key)) WITHOUT ROWID;
CREATE INDEX labels_by_value ON labels(key, value, job_id);

CREATE TABLE inputs(
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  digest TEXT NOT NULL, PRIMARY KEY(job_id, digest)) WITHOUT ROWID;
CREATE INDEX inputs_by_digest ON inputs(digest);

CREATE TABLE tasks(
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  type INTEGER NOT NULL, chunk_index INTEGER NOT NULL, state INTEGER NOT NULL DEFAULT 0,
  worker TEXT NOT NULL DEFAULT '', lease INTEGER NOT NULL DEFAULT 0,
  lease_until_ms INTEGER NOT NULL DEFAULT 0,
  crashes INTEGER NOT NULL DEFAULT 0, losses INTEGER NOT NULL DEFAULT 0,
  digest TEXT NOT NULL DEFAULT '', report_json TEXT NOT NULL DEFAULT '',
  elements INTEGER NOT NULL DEFAULT 0, error_sum_sq REAL NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, type, chunk_index)) WITHOUT ROWID;
CREATE INDEX open_tasks ON tasks(job_id, type, chunk_index) WHERE state < 2;
CREATE INDEX leased_tasks ON tasks(worker, lease_until_ms) WHERE state = 1;
CREATE INDEX tasks_by_digest ON tasks(digest) WHERE digest <> '';

CREATE TABLE artifacts(
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  position INTEGER NOT NULL, name TEXT NOT NULL, role TEXT NOT NULL, media_type TEXT NOT NULL,
  digest TEXT NOT NULL, bytes INTEGER NOT NULL, PRIMARY KEY(job_id, name)) WITHOUT ROWID;
CREATE INDEX artifacts_by_digest ON artifacts(digest);

CREATE TABLE uploads(digest TEXT PRIMARY KEY) WITHOUT ROWID;

CREATE TABLE events(
  sequence INTEGER PRIMARY KEY AUTOINCREMENT,
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  type TEXT NOT NULL, json TEXT NOT NULL, time_ms INTEGER NOT NULL);
CREATE INDEX events_by_job ON events(job_id, sequence);

CREATE TABLE idempotency(
  key TEXT PRIMARY KEY, request_digest TEXT NOT NULL,
  job_id TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE,
  created_ms INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX idempotency_by_job ON idempotency(job_id);
CREATE INDEX idempotency_by_age ON idempotency(created_ms);

CREATE TABLE workers(
  name TEXT PRIMARY KEY, process TEXT NOT NULL) WITHOUT ROWID;
)sql",
    R"sql(
ALTER TABLE workers ADD COLUMN missing_layers TEXT NOT NULL DEFAULT '';
)sql",
    // When a client last sent a blob, asked for it or ordered with it, in Unix milliseconds.
    R"sql(
ALTER TABLE uploads ADD COLUMN used_ms INTEGER NOT NULL DEFAULT 0;
UPDATE uploads SET used_ms=CAST(strftime('%s','now') AS INTEGER)*1000;
INSERT INTO counters VALUES ('collected_blobs', 0), ('collected_bytes', 0);
)sql",
};
constexpr int kSchemaVersion = sizeof(kMigrations) / sizeof(kMigrations[0]);

}  // namespace

void migrate(Database& db) {
  if (db.number(0, "PRAGMA user_version") == kSchemaVersion) return;
  Transaction transaction(db);
  const int64_t found = db.number(0, "PRAGMA user_version");
  if (found > kSchemaVersion)
    throw Error(ErrorCode::unavailable, "The store was written by a newer Lightkiln (schema " +
                                            std::to_string(found) + "; this program knows up to " +
                                            std::to_string(kSchemaVersion) + ").");
  for (int64_t version = found; version < kSchemaVersion; ++version)
    db.execute(kMigrations[version]);
  db.execute(("PRAGMA user_version=" + std::to_string(kSchemaVersion)).c_str());
  transaction.commit();
}

void check_integrity(Database& db) {
  Statement check = db.query("PRAGMA quick_check(1)");
  if (!check.step() || check.text(0) != "ok")
    throw Error(ErrorCode::internal, "The store's database is damaged: " + check.text(0) + ".");
}

}  // namespace lightkiln
