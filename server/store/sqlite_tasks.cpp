// The store as workers see it: claim under a lease, beat, commit, fail, release. A commit whose
// lease token is not the task's present one changes nothing.

#include <sstream>

#include "server/store/event_json.h"
#include "server/store/process_identity.h"
#include "server/store/sqlite_store.h"

namespace lightkiln {

namespace {

constexpr int kWaiting = static_cast<int>(TaskState::waiting);
constexpr int kChunk = static_cast<int>(TaskType::chunk);
constexpr int kAssemble = static_cast<int>(TaskType::assemble);

std::string task_name(const Claim& claim) {
  switch (claim.type) {
    case TaskType::plan:
      return "planning";
    case TaskType::chunk:
      return "chunk " + std::to_string(claim.chunk_index);
    case TaskType::assemble:
      return "assembling";
  }
  return "a task";
}

}  // namespace

// --- claim ---------------------------------------------------------------------------------------

void SqliteStore::register_worker(Database& db, const std::string& worker,
                                  const std::string& missing) {
  if (!own_workers_.insert(worker).second) return;
  db.run(
      "INSERT INTO workers(name,process,missing_layers) VALUES(?1,?2,?3) ON CONFLICT(name) DO "
      "UPDATE SET process=?2, missing_layers=?3",
      worker, own_identity_, missing);
}

void SqliteStore::enlist(const std::string& worker,
                         const std::vector<std::string>& missing_layers) {
  std::string names;
  for (const std::string& layer : missing_layers) names += (names.empty() ? "" : " ") + layer;
  Writer writer(*this, Durability::with_the_next);
  expire_dead_workers(writer.db());
  register_worker(writer.db(), worker, names);
  writer.commit();
}

std::vector<WorkerRecord> SqliteStore::workers() {
  ReadAccess read(*this);
  Statement rows =
      read.db().query("SELECT name, process, missing_layers FROM workers ORDER BY name");
  std::vector<WorkerRecord> workers;
  while (rows.step()) {
    if (is_provably_dead(rows.text(1))) continue;
    std::istringstream words(rows.text(2));
    WorkerRecord& worker = workers.emplace_back();
    worker.name = rows.text(0);
    for (std::string layer; words >> layer;) worker.missing_layers.push_back(layer);
  }
  return workers;
}

// Whether a claim could find something; reads only, so that idle workers write nothing.
bool SqliteStore::maybe_work(Database& db) {
  if (db.number(0,
                "SELECT EXISTS(SELECT 1 FROM jobs j JOIN tasks t ON t.job_id=j.id WHERE j.state<2 "
                "AND t.state<2 AND (t.state=0 OR t.lease_until_ms<=?1))",
                lease_clock_ms()) != 0)
    return true;
  Statement rows = db.query(
      "SELECT DISTINCT w.process FROM workers w JOIN tasks t ON t.worker=w.name WHERE t.state=1");
  while (rows.step())
    if (is_provably_dead(rows.text(0))) return true;
  return false;
}

void SqliteStore::expire_dead_workers(Database& db) {
  std::vector<std::string> dead;
  {
    Statement rows = db.query("SELECT name, process FROM workers");
    while (rows.step())
      if (rows.text(1) != own_identity_ && is_provably_dead(rows.text(1)))
        dead.push_back(rows.text(0));
  }
  for (const std::string& worker : dead) {
    db.run("UPDATE tasks SET lease_until_ms=0 WHERE worker=?1 AND state=1", worker);
    db.run("DELETE FROM workers WHERE name=?1", worker);
  }
}

// Counts a lease that ended without a word; true when that was once too often and the job failed.
bool SqliteStore::lose_lease(Database& db, const Claim& claim, int losses) {
  db.run(
      "UPDATE tasks SET state=0, lease=0, worker='', losses=?4 WHERE job_id=?1 AND type=?2 AND "
      "chunk_index=?3",
      claim.job_id, static_cast<int>(claim.type), claim.chunk_index, losses);
  add_event(db, claim.job_id, "log",
            EventJson()
                .text("message", "The worker of " + task_name(claim) + " was lost.")
                .count("losses", static_cast<uint64_t>(losses))
                .take());
  if (after_lost_lease(losses) == TaskVerdict::try_again) return false;
  fail_job(db, claim.job_id,
           {"worker_lost",
            "Three workers were lost one after another while they worked on " + task_name(claim) +
                " of this job.",
            ""});
  return true;
}

std::optional<Claim> SqliteStore::claim(const std::string& worker, const std::string& prefer_job) {
  {
    ReadAccess read(*this);
    if (!maybe_work(read.db())) return std::nullopt;
  }
  Writer writer(*this, Durability::with_the_next);
  Database& db = writer.db();
  expire_dead_workers(db);
  std::optional<Claim> claim;
  while (!claim) {
    bool was_leased = false;
    int losses = 0;
    {
      const int64_t now_ms = lease_clock_ms();
      Statement preferred = db.query(
          "SELECT t.job_id, t.type, t.chunk_index, t.state, t.losses, j.priority FROM jobs j CROSS "
          "JOIN tasks t ON t.job_id=j.id WHERE j.id=?2 AND j.state<2 AND t.state<2 AND (t.state=0 "
          "OR "
          "t.lease_until_ms<=?1) ORDER BY t.type, t.chunk_index LIMIT 1",
          now_ms, prefer_job);
      Statement any = db.query(
          "SELECT t.job_id, t.type, t.chunk_index, t.state, t.losses, j.priority FROM jobs j CROSS "
          "JOIN tasks t ON t.job_id=j.id WHERE j.state<2 AND t.state<2 AND (t.state=0 OR "
          "t.lease_until_ms<=?1) "
          "ORDER BY j.priority DESC, j.id, t.type, t.chunk_index LIMIT 1",
          now_ms);
      // Two walks along an index, where one order by (priority, preferred, id) would sort all
      // tasks.
      if (!any.step()) break;
      const bool prefer = preferred.step() && preferred.integer(5) >= any.integer(5);
      const Statement& row = prefer ? preferred : any;
      claim.emplace();
      claim->job_id = row.text(0);
      claim->type = static_cast<TaskType>(row.integer(1));
      claim->chunk_index = row.natural(2);
      was_leased = row.integer(3) != kWaiting;
      losses = static_cast<int>(row.integer(4));
    }
    if (was_leased && lose_lease(db, *claim, losses + 1)) claim.reset();
  }
  if (claim) {
    register_worker(db, worker, "");
    claim->lease = static_cast<uint64_t>(
        db.number(0, "UPDATE counters SET value=value+1 WHERE name='lease' RETURNING value"));
    db.run(
        "UPDATE tasks SET state=1, worker=?4, lease=?5, lease_until_ms=?6 WHERE job_id=?1 AND "
        "type=?2 AND chunk_index=?3",
        claim->job_id, static_cast<int>(claim->type), claim->chunk_index, worker, claim->lease,
        lease_clock_ms() + options_.lease_ms);
    move_job(db, claim->job_id, JobEvent::task_claimed, "");
    Statement texts =
        db.query("SELECT spec_json, plan_json FROM documents WHERE job_id=?1", claim->job_id);
    texts.step();
    claim->spec_json = texts.text(0);
    if (claim->type != TaskType::plan) claim->plan_json = texts.text(1);
  }
  writer.commit();
  return claim;
}

bool SqliteStore::heartbeat(const Claim& claim, double fraction) {
  Writer writer(*this, Durability::with_the_next);
  Database& db = writer.db();
  if (!holds(db, claim)) return false;
  db.run("UPDATE tasks SET lease_until_ms=?4 WHERE job_id=?1 AND type=?2 AND chunk_index=?3",
         claim.job_id, static_cast<int>(claim.type), claim.chunk_index,
         lease_clock_ms() + options_.lease_ms);
  if (db.run("UPDATE jobs SET chunk_fraction=?2 WHERE id=?1 AND chunk_fraction<>?2", claim.job_id,
             fraction) > 0) {
    touch(db, claim.job_id);
    add_event(db, claim.job_id, "progress",
              EventJson().count("chunk", claim.chunk_index).number("fraction", fraction).take());
  }
  writer.commit();
  return true;
}

bool SqliteStore::holds_lease(const Claim& claim) {
  ReadAccess read(*this);
  return holds(read.db(), claim);
}

// --- commits -------------------------------------------------------------------------------------

void SqliteStore::commit_plan(const Claim& claim, const std::string& plan_json, uint64_t chunks,
                              double predicted_s) {
  Writer writer(*this);
  Database& db = writer.db();
  if (claim.type != TaskType::plan || !holds(db, claim)) return;
  db.run("UPDATE documents SET plan_json=?2 WHERE job_id=?1", claim.job_id, plan_json);
  db.run("UPDATE jobs SET chunks_total=?2, predicted_s=?3, chunk_fraction=0 WHERE id=?1",
         claim.job_id, chunks, predicted_s);
  db.run("UPDATE tasks SET state=2, lease=0, worker='' WHERE job_id=?1 AND type=?2", claim.job_id,
         static_cast<int>(TaskType::plan));
  add_event(db, claim.job_id, "plan",
            EventJson().count("chunks", chunks).number("predicted_s", predicted_s).take());
  if (db.number(0, "SELECT plan_only FROM jobs WHERE id=?1", claim.job_id) != 0) {
    move_job(db, claim.job_id, JobEvent::plan_only_committed, "");
  } else {
    move_job(db, claim.job_id, JobEvent::plan_committed, kWaitingForWorker);
    for (uint64_t index = 0; index < chunks; ++index)
      db.run("INSERT INTO tasks(job_id,type,chunk_index) VALUES(?1,?2,?3)", claim.job_id, kChunk,
             index);
  }
  writer.commit();
}

void SqliteStore::commit_chunk(const Claim& claim, const ChunkCommit& chunk) {
  if (claim.type != TaskType::chunk) return;
  const std::string digest = blobs_.put(chunk.bytes);
  Writer writer(*this);
  Database& db = writer.db();
  if (!holds(db, claim)) {
    remove_orphans(db, {digest});
    return;
  }
  // Again under the lock: an equal file may have been an orphan meanwhile.
  blobs_.put(chunk.bytes, digest);
  db.run(
      "UPDATE tasks SET state=2, lease=0, worker='', digest=?3, report_json=?4, elements=?6, "
      "error_sum_sq=?7 WHERE job_id=?1 AND type=?2 AND chunk_index=?5",
      claim.job_id, kChunk, digest, chunk.report_json, claim.chunk_index, chunk.elements,
      chunk.error_sum_sq);
  sum_chunks(db, claim.job_id);
  const int64_t left =
      db.number(0, "SELECT chunks_total-chunks_done FROM jobs WHERE id=?1", claim.job_id);
  const auto job = read_job(db, claim.job_id);
  add_event(db, claim.job_id, "chunk",
            EventJson()
                .count("index", claim.chunk_index)
                .count("done", job->chunks_done)
                .count("total", job->chunks_total)
                .number("error", job->current_error)
                .take());
  if (left == 0) {
    db.run("INSERT INTO tasks(job_id,type,chunk_index) VALUES(?1,?2,0)", claim.job_id, kAssemble);
    move_job(db, claim.job_id, JobEvent::last_chunk_committed, kWaitingForWorker);
  }
  writer.commit();
}

void SqliteStore::load_chunks(const std::string& job_id,
                              const std::function<void(StoredChunk)>& take) {
  std::vector<std::pair<std::string, std::string>> rows_found;
  {
    ReadAccess read(*this);
    Statement rows = read.db().query(
        "SELECT digest, report_json FROM tasks WHERE job_id=?1 AND type=?2 AND state=2 AND "
        "digest<>'' ORDER BY chunk_index",
        job_id, kChunk);
    while (rows.step()) rows_found.emplace_back(rows.text(0), rows.text(1));
  }
  for (const auto& [digest, report] : rows_found) {
    const std::string bytes = blobs_.read(digest);
    const auto* begin = reinterpret_cast<const std::byte*>(bytes.data());
    take({{begin, begin + bytes.size()}, report});
  }
}

bool SqliteStore::rebake_lost_chunks(const Claim& claim) {
  Writer writer(*this);
  Database& db = writer.db();
  if (claim.type != TaskType::assemble || !holds(db, claim)) return false;
  const std::vector<uint64_t> lost = lost_chunks(db, claim.job_id);
  if (lost.empty()) return false;
  bool too_often = false;
  for (const uint64_t index : lost) {
    const int64_t crashes =
        db.number(0,
                  "UPDATE tasks SET crashes=crashes+1 WHERE job_id=?1 AND type=?2 AND "
                  "chunk_index=?3 RETURNING crashes",
                  claim.job_id, kChunk, index);
    too_often |=
        after_crash(static_cast<int>(crashes), options_.max_attempts) == TaskVerdict::fail_job;
    add_event(
        db, claim.job_id, "log",
        EventJson()
            .text("message", "The stored chunk " + std::to_string(index) + " was damaged or lost.")
            .take());
  }
  if (too_often) {
    fail_job(
        db, claim.job_id,
        {error_code_name(ErrorCode::internal),
         "Stored chunks of this job were damaged again and again; check the disk of the store.",
         ""});
  } else {
    bake_again(db, claim.job_id, lost);
    move_job(db, claim.job_id, JobEvent::chunks_lost, "Baking damaged chunks again.");
  }
  writer.commit();
  return true;
}

// --- bad ends ------------------------------------------------------------------------------------

void SqliteStore::fail_task(const Claim& claim, const JobError& error, bool crashed) {
  Writer writer(*this);
  Database& db = writer.db();
  if (!holds(db, claim)) return;
  db.run("UPDATE jobs SET attempts=attempts+1, chunk_fraction=0 WHERE id=?1", claim.job_id);
  const int crashes = static_cast<int>(
      db.number(0,
                "UPDATE tasks SET state=0, lease=0, worker='', crashes=crashes+?4 WHERE job_id=?1 "
                "AND type=?2 AND chunk_index=?3 RETURNING crashes",
                claim.job_id, static_cast<int>(claim.type), claim.chunk_index, crashed ? 1 : 0));
  add_event(db, claim.job_id, "log",
            EventJson().text("message", error.detail).text("code", error.code).take());
  if (!crashed || after_crash(crashes, options_.max_attempts) == TaskVerdict::fail_job) {
    fail_job(db, claim.job_id, error);
  } else {
    db.run("UPDATE jobs SET reason=?2 WHERE id=?1", claim.job_id,
           "Trying " + task_name(claim) + " again: " + error.detail);
    touch(db, claim.job_id);
  }
  writer.commit();
}

void SqliteStore::release(const Claim& claim, const std::string& reason) {
  Writer writer(*this, Durability::with_the_next);
  Database& db = writer.db();
  if (!holds(db, claim)) return;
  db.run(
      "UPDATE tasks SET state=0, lease=0, worker='', lease_until_ms=0 WHERE job_id=?1 AND type=?2 "
      "AND chunk_index=?3",
      claim.job_id, static_cast<int>(claim.type), claim.chunk_index);
  db.run("UPDATE jobs SET chunk_fraction=0, reason=?2 WHERE id=?1", claim.job_id, reason);
  touch(db, claim.job_id);
  writer.commit();
}

void SqliteStore::wait_for_work(int64_t wait_ms) {
  const int64_t deadline_ms = lease_clock_ms() + wait_ms;
  for (;;) {
    const uint32_t seen = wake_.value();
    {
      ReadAccess read(*this);
      if (maybe_work(read.db())) return;
    }
    const int64_t left_ms = deadline_ms - lease_clock_ms();
    if (left_ms <= 0) return;
    wake_.wait(seen, left_ms);
  }
}

}  // namespace lightkiln
