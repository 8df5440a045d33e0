// The store as clients see it: submit, read, cancel, retry, remove, wait.

#include <algorithm>
#include <cmath>

#include "server/store/event_json.h"
#include "server/store/job_id.h"
#include "server/store/sqlite_store.h"

namespace lightkiln {

namespace {

constexpr int64_t kIdempotencyMs = 7ll * 24 * 3600 * 1000;

#define LIGHTKILN_JOB_COLUMNS                                                               \
  "id, name, kind, spec_digest, priority, plan_only, state, stage, reason, chunks_total, "  \
  "chunks_done, chunk_fraction, error_sum_sq, error_elements, target_error, predicted_s, "  \
  "from_cache, attempts, error_code, error_detail, error_pointer, created_ms, started_ms, " \
  "finished_ms, version"

int limited(int limit, int most) {
  return std::clamp(limit, 1, most);
}

}  // namespace

JobRecord SqliteStore::read_job(Database& db, const Statement& row, bool documents) {
  JobRecord job;
  int column = 0;
  job.id = row.text(column++);
  job.name = row.text(column++);
  job.kind = row.text(column++);
  job.spec_digest = row.text(column++);
  job.priority = static_cast<int>(row.integer(column++));
  job.plan_only = row.integer(column++) != 0;
  job.state = static_cast<JobState>(row.integer(column++));
  job.stage = static_cast<JobStage>(row.integer(column++));
  job.reason = row.text(column++);
  job.chunks_total = row.natural(column++);
  job.chunks_done = row.natural(column++);
  job.chunk_fraction = row.real(column++);
  const double error_sum_sq = row.real(column++);
  const double error_elements = row.real(column++);
  job.current_error = error_elements > 0 ? std::sqrt(error_sum_sq / error_elements) : 0;
  job.target_error = row.real(column++);
  job.predicted_s = row.real(column++);
  job.from_cache = row.integer(column++) != 0;
  job.attempts = static_cast<int>(row.integer(column++));
  JobError error;
  error.code = row.text(column++);
  error.detail = row.text(column++);
  error.pointer = row.text(column++);
  if (!error.code.empty()) job.error = error;
  job.created_ms = row.integer(column++);
  job.started_ms = row.integer(column++);
  job.finished_ms = row.integer(column++);
  job.version = row.natural(column++);

  Statement labels = db.query("SELECT key, value FROM labels WHERE job_id=?1", job.id);
  while (labels.step()) job.labels[labels.text(0)] = labels.text(1);
  if (!documents) return job;
  Statement texts =
      db.query("SELECT spec_json, plan_json, accuracy_json FROM documents WHERE job_id=?1", job.id);
  if (texts.step()) {
    job.spec_json = texts.text(0);
    job.plan_json = texts.text(1);
    job.accuracy_json = texts.text(2);
  }
  return job;
}

std::optional<JobRecord> SqliteStore::read_job(Database& db, const std::string& id) {
  Statement row = db.query("SELECT " LIGHTKILN_JOB_COLUMNS " FROM jobs WHERE id=?1", id);
  if (!row.step()) return std::nullopt;
  return read_job(db, row, true);
}

std::optional<JobRecord> SqliteStore::find_job(const std::string& id) {
  ReadAccess read(*this);
  return read_job(read.db(), id);
}

std::vector<JobRecord> SqliteStore::list_jobs(const JobFilter& filter) {
  ReadAccess read(*this);
  // '' stands for "any" in each condition; ids are compared as text, newest first.
  Statement rows = read.db().query(
      "SELECT " LIGHTKILN_JOB_COLUMNS
      " FROM jobs WHERE (?1<0 OR state=?1) AND (?2='' OR kind=?2) AND (?3='' OR id<?3) "
      "AND (?4='' OR instr(lower(name),lower(?4))>0 OR instr(lower(id),lower(?4))>0) "
      "AND (?5='' OR EXISTS(SELECT 1 FROM labels l WHERE l.job_id=jobs.id AND l.key=?5 AND "
      "l.value=?6)) ORDER BY id DESC LIMIT ?7",
      filter.state ? static_cast<int>(*filter.state) : -1, filter.kind, filter.after, filter.text,
      filter.label ? filter.label->first : std::string(),
      filter.label ? filter.label->second : std::string(), limited(filter.limit, 500));
  std::vector<JobRecord> jobs;
  while (rows.step()) jobs.push_back(read_job(read.db(), rows, false));
  return jobs;
}

uint64_t SqliteStore::list_version() {
  ReadAccess read(*this);
  return static_cast<uint64_t>(
      read.db().number(0, "SELECT value FROM counters WHERE name='version'"));
}

// --- submit --------------------------------------------------------------------------------------

// An equal order (same canonical spec, same engine) that succeeded earlier answers at once with the
// same artifacts. Equal orders that are still on their way run side by side: each is deterministic,
// so they agree, and neither depends on the other being cancelled or removed.
bool SqliteStore::answer_from_cache(Database& db, const std::string& id,
                                    const Submission& submission) {
  std::string source;
  {
    Statement row = db.query(
        "SELECT id FROM jobs WHERE spec_digest=?1 AND state=?2 AND id<>?3 AND (plan_only=0 OR ?4) "
        "ORDER BY plan_only, id DESC LIMIT 1",
        submission.spec_digest, static_cast<int>(JobState::succeeded), id,
        submission.plan_only ? 1 : 0);
    if (!row.step()) return false;
    source = row.text(0);
  }
  if (!submission.plan_only) {
    if (!has_artifacts(db, source)) return false;
    db.run(
        "INSERT INTO artifacts SELECT ?2, position, name, role, media_type, digest, bytes FROM "
        "artifacts WHERE job_id=?1",
        source, id);
    db.run(
        "INSERT INTO tasks(job_id,type,chunk_index,state,report_json) SELECT ?2, type, "
        "chunk_index, "
        "2, report_json FROM tasks WHERE job_id=?1",
        source, id);
    db.run(
        "UPDATE jobs SET (chunks_done, error_sum_sq, error_elements) = (SELECT chunks_done, "
        "error_sum_sq, error_elements FROM jobs WHERE id=?1) WHERE id=?2",
        source, id);
    db.run(
        "UPDATE documents SET accuracy_json=(SELECT accuracy_json FROM documents WHERE job_id=?1) "
        "WHERE job_id=?2",
        source, id);
  }
  db.run(
      "UPDATE jobs SET from_cache=1, (chunks_total, predicted_s) = (SELECT chunks_total, "
      "predicted_s FROM jobs WHERE id=?1) WHERE id=?2",
      source, id);
  db.run(
      "UPDATE documents SET plan_json=(SELECT plan_json FROM documents WHERE job_id=?1) WHERE "
      "job_id=?2",
      source, id);
  move_job(db, id, JobEvent::answered_from_cache, "Answered by the result of job " + source + ".");
  return true;
}

bool SqliteStore::has_artifacts(Database& db, const std::string& id) {
  Statement rows = db.query("SELECT digest FROM artifacts WHERE job_id=?1", id);
  while (rows.step())
    if (!blobs_.has(rows.text(0))) return false;
  return true;
}

// The job that an equal key and body made before. A key whose job has lost artifacts is forgotten:
// the order is baked anew, which also restores the bytes that the earlier job refers to.
std::optional<std::string> SqliteStore::replay(Database& db, const Submission& submission) {
  if (submission.idempotency_key.empty()) return std::nullopt;
  db.run("DELETE FROM idempotency WHERE created_ms<?1", wall_clock_ms() - kIdempotencyMs);
  std::string id;
  {
    Statement seen = db.query("SELECT request_digest, job_id FROM idempotency WHERE key=?1",
                              submission.idempotency_key);
    if (!seen.step()) return std::nullopt;
    if (seen.text(0) != submission.request_digest)
      throw Error(ErrorCode::conflict,
                  "This Idempotency-Key was used before with another request.");
    id = seen.text(1);
  }
  if (has_artifacts(db, id)) return id;
  db.run("DELETE FROM idempotency WHERE key=?1", submission.idempotency_key);
  return std::nullopt;
}

// The age of an unused upload counts from its last order, and from when that was forgotten.
void SqliteStore::touch_inputs(Database& db, const std::string& id) {
  db.run(
      "UPDATE uploads SET used_ms=?2 WHERE digest IN (SELECT digest FROM inputs WHERE job_id=?1)",
      id, wall_clock_ms());
}

SubmitResult SqliteStore::submit(const Submission& submission) {
  require_space();
  Writer writer(*this);
  Database& db = writer.db();
  const int64_t now_ms = wall_clock_ms();
  if (const auto earlier = replay(db, submission)) return {*earlier, true};
  std::string missing;
  for (const std::string& digest : submission.inputs)
    if (!blobs_.has(digest)) missing += (missing.empty() ? "" : ", ") + digest;
  if (!missing.empty())
    throw Error(ErrorCode::not_found, "Upload these inputs first: " + missing + ".");
  if (static_cast<uint64_t>(db.number(0, "SELECT count(*) FROM jobs WHERE state=?1",
                                      static_cast<int>(JobState::queued))) >= options_.max_queued)
    throw StoreRefusal(kQueueFull, "The queue is full; try again later.");

  std::string last;
  {
    Statement row = db.query("SELECT max(id) FROM jobs");
    if (row.step()) last = row.text(0);
  }
  const std::string id = make_job_id(now_ms, last);
  db.run(
      "INSERT INTO jobs(id,name,kind,spec_digest,priority,plan_only,state,stage,reason,"
      "target_error,created_ms,version) VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9,?10,?11,?12)",
      id, submission.name, submission.kind, submission.spec_digest, submission.priority,
      submission.plan_only ? 1 : 0, static_cast<int>(JobState::queued),
      static_cast<int>(JobStage::plan), kWaitingForWorker, submission.target_error, now_ms,
      raise_version(db));
  db.run("INSERT INTO documents(job_id,spec_json) VALUES(?1,?2)", id, submission.spec_json);
  for (const auto& [key, value] : submission.labels)
    db.run("INSERT INTO labels VALUES(?1,?2,?3)", id, key, value);
  for (const std::string& digest : submission.inputs)
    db.run("INSERT OR IGNORE INTO inputs VALUES(?1,?2)", id, digest);
  touch_inputs(db, id);
  if (!submission.idempotency_key.empty())
    db.run("INSERT INTO idempotency VALUES(?1,?2,?3,?4)", submission.idempotency_key,
           submission.request_digest, id, now_ms);
  add_event(db, id, "state", EventJson().text("state", "queued").text("stage", "plan").take());
  if (!answer_from_cache(db, id, submission))
    db.run("INSERT INTO tasks(job_id,type,chunk_index) VALUES(?1,?2,0)", id,
           static_cast<int>(TaskType::plan));
  writer.commit();
  return {id, false};
}

// --- changes by clients --------------------------------------------------------------------------

void SqliteStore::cancel(const std::string& id) {
  Writer writer(*this);
  const JobPosition before = position(writer.db(), id);
  if (is_terminal(before.state))
    throw Error(ErrorCode::conflict,
                std::string("The job is ") + job_state_name(before.state) + " already.");
  move_job(writer.db(), id, JobEvent::cancelled, "Cancelled by a client.");
  writer.commit();
}

void SqliteStore::retry(const std::string& id) {
  Writer writer(*this);
  Database& db = writer.db();
  const JobPosition before = position(db, id);
  if (!next_position(before, JobEvent::retried))
    throw Error(ErrorCode::conflict, std::string("Only a failed or cancelled job can be retried; "
                                                 "this one is ") +
                                         job_state_name(before.state) + ".");
  const std::vector<uint64_t> lost = lost_chunks(db, id);
  db.run("UPDATE tasks SET crashes=0, losses=0 WHERE job_id=?1", id);
  db.run(
      "UPDATE jobs SET error_code='', error_detail='', error_pointer='', finished_ms=0 WHERE "
      "id=?1",
      id);
  move_job(db, id, JobEvent::retried, kWaitingForWorker);
  if (!lost.empty()) {
    bake_again(db, id, lost);
    db.run("UPDATE jobs SET stage=?2 WHERE id=?1", id, static_cast<int>(JobStage::bake));
  }
  writer.commit();
}

void SqliteStore::remove(const std::string& id) {
  Writer writer(*this);
  Database& db = writer.db();
  if (!can_remove(position(db, id).state))
    throw Error(ErrorCode::conflict, "The job is running; cancel it first.");
  std::vector<std::string> orphans;
  drop_chunk_bytes(db, id, &orphans);
  {
    Statement rows = db.query("SELECT digest FROM artifacts WHERE job_id=?1", id);
    while (rows.step()) orphans.push_back(rows.text(0));
  }
  raise_version(db);
  touch_inputs(db, id);
  db.run("DELETE FROM jobs WHERE id=?1", id);
  writer.commit();
  remove_orphans(db, orphans);
}

// --- reads beside the job ------------------------------------------------------------------------

std::vector<ArtifactRecord> SqliteStore::artifacts(const std::string& id) {
  ReadAccess read(*this);
  Statement rows = read.db().query(
      "SELECT name, role, media_type, digest, bytes FROM artifacts WHERE job_id=?1 ORDER BY "
      "position",
      id);
  std::vector<ArtifactRecord> artifacts;
  while (rows.step())
    artifacts.push_back({rows.text(0), rows.text(1), rows.text(2), rows.text(3), rows.natural(4)});
  return artifacts;
}

std::vector<EventRecord> SqliteStore::events(const std::string& job_id, uint64_t after, int limit) {
  ReadAccess read(*this);
  Statement rows = read.db().query(
      "SELECT sequence, job_id, type, json, time_ms FROM events WHERE (?1='' OR job_id=?1) AND "
      "sequence>?2 ORDER BY sequence LIMIT ?3",
      job_id, after, limited(limit, 10000));
  std::vector<EventRecord> events;
  while (rows.step())
    events.push_back({rows.natural(0), rows.text(1), rows.text(2), rows.text(3), rows.integer(4)});
  return events;
}

std::vector<std::string> SqliteStore::chunk_reports(const std::string& id) {
  ReadAccess read(*this);
  Statement rows = read.db().query(
      "SELECT report_json FROM tasks WHERE job_id=?1 AND type=?2 AND state=2 ORDER BY chunk_index",
      id, static_cast<int>(TaskType::chunk));
  std::vector<std::string> reports;
  while (rows.step()) reports.push_back(rows.text(0));
  return reports;
}

std::optional<JobRecord> SqliteStore::wait_job(const std::string& id, uint64_t version,
                                               int64_t wait_ms) {
  const int64_t deadline_ms = lease_clock_ms() + wait_ms;
  for (;;) {
    const uint32_t seen = wake_.value();
    {
      ReadAccess read(*this);
      Statement row = read.db().query("SELECT state, version FROM jobs WHERE id=?1", id);
      if (!row.step()) return std::nullopt;
      if (is_terminal(static_cast<JobState>(row.integer(0))) || row.natural(1) > version) break;
    }
    const int64_t left_ms = deadline_ms - lease_clock_ms();
    if (left_ms <= 0) break;
    wake_.wait(seen, left_ms);
  }
  return find_job(id);
}

}  // namespace lightkiln
