// What every change of a job shares: versions, events, moves of the state machine, and which bytes
// nobody needs any more.

#include "server/store/event_json.h"
#include "server/store/sqlite_store.h"

namespace lightkiln {

uint64_t SqliteStore::raise_version(Database& db) {
  return static_cast<uint64_t>(
      db.number(0, "UPDATE counters SET value=value+1 WHERE name='version' RETURNING value"));
}

void SqliteStore::touch(Database& db, const std::string& id) {
  db.run("UPDATE jobs SET version=?2 WHERE id=?1", id, raise_version(db));
}

void SqliteStore::add_event(Database& db, const std::string& id, const char* type,
                            const std::string& json) {
  db.run("INSERT INTO events(job_id,type,json,time_ms) VALUES(?1,?2,?3,?4)", id, type, json,
         wall_clock_ms());
}

JobPosition SqliteStore::position(Database& db, const std::string& id) {
  Statement row = db.query("SELECT state, stage FROM jobs WHERE id=?1", id);
  if (!row.step()) throw Error(ErrorCode::not_found, "There is no job '" + id + "'.");
  return {static_cast<JobState>(row.integer(0)), static_cast<JobStage>(row.integer(1))};
}

void SqliteStore::move_job(Database& db, const std::string& id, JobEvent event,
                           const std::string& reason) {
  const JobPosition before = position(db, id);
  const std::optional<JobPosition> after = next_position(before, event);
  if (!after)
    throw Error(ErrorCode::conflict, std::string("A job that is ") + job_state_name(before.state) +
                                         " in stage " + job_stage_name(before.stage) +
                                         " cannot take this step.");
  db.run("UPDATE jobs SET state=?2, stage=?3, reason=?4, version=?5 WHERE id=?1", id,
         static_cast<int>(after->state), static_cast<int>(after->stage), reason, raise_version(db));
  if (before.state == JobState::queued && after->state == JobState::running)
    db.run("UPDATE jobs SET started_ms=?2 WHERE id=?1 AND started_ms=0", id, wall_clock_ms());
  if (is_terminal(after->state)) {
    db.run("UPDATE jobs SET finished_ms=?2, chunk_fraction=0 WHERE id=?1", id, wall_clock_ms());
    db.run("DELETE FROM events WHERE job_id=?1 AND type='progress'", id);
    drop_leases(db, id);
  }
  if (before == *after) return;
  EventJson payload;
  payload.text("state", job_state_name(after->state)).text("stage", job_stage_name(after->stage));
  if (!reason.empty()) payload.text("reason", reason);
  add_event(db, id, "state", payload.take());
}

void SqliteStore::drop_leases(Database& db, const std::string& id) {
  db.run(
      "UPDATE tasks SET state=0, worker='', lease=0, lease_until_ms=0 WHERE job_id=?1 AND state=1",
      id);
}

void SqliteStore::fail_job(Database& db, const std::string& id, const JobError& error) {
  db.run("UPDATE jobs SET error_code=?2, error_detail=?3, error_pointer=?4 WHERE id=?1", id,
         error.code, error.detail, error.pointer);
  move_job(db, id, JobEvent::failed, error.detail);
}

bool SqliteStore::holds(Database& db, const Claim& claim) {
  return db.number(0,
                   "SELECT count(*) FROM tasks t JOIN jobs j ON j.id=t.job_id WHERE t.job_id=?1 "
                   "AND t.type=?2 AND t.chunk_index=?3 AND t.lease=?4 AND t.state=1 AND j.state=?5",
                   claim.job_id, static_cast<int>(claim.type), claim.chunk_index, claim.lease,
                   static_cast<int>(JobState::running)) == 1;
}

void SqliteStore::drop_chunk_bytes(Database& db, const std::string& id,
                                   std::vector<std::string>* orphans) {
  {
    Statement rows = db.query("SELECT digest FROM tasks WHERE job_id=?1 AND digest<>''", id);
    while (rows.step()) orphans->push_back(rows.text(0));
  }
  db.run("UPDATE tasks SET digest='' WHERE job_id=?1 AND digest<>''", id);
}

// Finished chunks whose bytes were set aside as damaged, or are gone.
std::vector<uint64_t> SqliteStore::lost_chunks(Database& db, const std::string& id) {
  std::vector<uint64_t> lost;
  Statement rows =
      db.query("SELECT chunk_index, digest FROM tasks WHERE job_id=?1 AND type=?2 AND state=2", id,
               static_cast<int>(TaskType::chunk));
  while (rows.step())
    if (!blobs_.has(rows.text(1))) lost.push_back(rows.natural(0));
  return lost;
}

// They wait for a worker once more, and assembling waits for them; the stage is the caller's.
void SqliteStore::bake_again(Database& db, const std::string& id,
                             const std::vector<uint64_t>& chunks) {
  for (const uint64_t index : chunks)
    db.run(
        "UPDATE tasks SET state=0, lease_until_ms=0, digest='', report_json='', elements=0, "
        "error_sum_sq=0 WHERE job_id=?1 AND type=?2 AND chunk_index=?3",
        id, static_cast<int>(TaskType::chunk), index);
  db.run("DELETE FROM tasks WHERE job_id=?1 AND type=?2", id, static_cast<int>(TaskType::assemble));
  sum_chunks(db, id);
}

void SqliteStore::sum_chunks(Database& db, const std::string& id) {
  db.run(
      "UPDATE jobs SET chunk_fraction=0, version=?3, reason=CASE WHEN EXISTS(SELECT 1 FROM tasks "
      "WHERE job_id=?1 AND state=1) THEN '' ELSE ?4 END, (chunks_done, error_sum_sq, "
      "error_elements) = (SELECT count(*), coalesce(sum(error_sum_sq),0), "
      "coalesce(sum(elements),0) FROM tasks WHERE job_id=?1 AND type=?2 AND state=2) WHERE id=?1",
      id, static_cast<int>(TaskType::chunk), raise_version(db), kWaitingForWorker);
}

// A file is removed after the commit that made it an orphan, and still under the lock, so that
// nobody can begin to refer to it in between. A crash between the two leaves a file too many.
void SqliteStore::remove_orphans(Database& db, const std::vector<std::string>& digests) {
  for (const std::string& digest : digests) {
    if (!was_used_since(db, digest, 0) && !is_referred_to(db, digest)) blobs_.remove(digest);
  }
}

bool SqliteStore::is_referred_to(Database& db, const std::string& digest) {
  return db.number(0,
                   "SELECT EXISTS(SELECT 1 FROM inputs WHERE digest=?1) OR EXISTS(SELECT 1 FROM "
                   "artifacts WHERE digest=?1) OR EXISTS(SELECT 1 FROM tasks WHERE digest=?1 AND "
                   "digest<>'')",
                   digest) != 0;
}

bool SqliteStore::was_used_since(Database& db, const std::string& digest, int64_t used_ms) {
  return db.number(0, "SELECT EXISTS(SELECT 1 FROM uploads WHERE digest=?1 AND used_ms>=?2)",
                   digest, used_ms) != 0;
}

}  // namespace lightkiln
