// The result of a job on its way into the store: artifacts are written as they come, and become
// visible together.

#include "core/base/parallel.h"
#include "server/store/event_json.h"
#include "server/store/sqlite_store.h"

namespace lightkiln {

namespace {

constexpr int kWritingThreads = 8;
// Artifacts held before they are written. Small ones go side by side, because each waits for the
// disk and the disk serves many waits at once.
constexpr size_t kMostWaitingBytes = 64u << 20;

class SqliteResult final : public Store::Result {
 public:
  SqliteResult(SqliteStore& store, const Claim& claim) : store_(store), claim_(claim) {}

  ~SqliteResult() override {
    if (committed_ || written_.empty()) return;
    try {
      store_.forget(written_);
    } catch (const Error&) {
      // They stay as files that nobody refers to, for collect_unused().
    }
  }

  void add(NewArtifact artifact) override {
    waiting_bytes_ += artifact.bytes.size();
    waiting_.push_back(std::move(artifact));
    if (waiting_bytes_ >= kMostWaitingBytes) write_waiting();
  }

  void commit(const std::string& accuracy_json) override {
    write_waiting();
    committed_ = store_.commit_artifacts(claim_, written_, accuracy_json);
  }

 private:
  void write_waiting() {
    const size_t first = written_.size();
    for (const NewArtifact& one : waiting_)
      written_.push_back({one.name, one.role, one.media_type, "", one.bytes.size()});
    Progress unwatched;
    parallel_blocks(waiting_.size(), 1, kWritingThreads, unwatched, [&](size_t begin, size_t) {
      written_[first + begin].digest = store_.blobs().put(waiting_[begin].bytes);
    });
    waiting_.clear();
    waiting_bytes_ = 0;
  }

  SqliteStore& store_;
  const Claim claim_;
  std::vector<NewArtifact> waiting_;
  size_t waiting_bytes_ = 0;
  std::vector<ArtifactRecord> written_;  // a digest of "" was not written after all
  bool committed_ = false;
};

}  // namespace

std::unique_ptr<Store::Result> SqliteStore::begin_result(const Claim& claim) {
  return std::make_unique<SqliteResult>(*this, claim);
}

void SqliteStore::forget(const std::vector<ArtifactRecord>& artifacts) {
  std::vector<std::string> digests;
  for (const ArtifactRecord& artifact : artifacts)
    if (!artifact.digest.empty()) digests.push_back(artifact.digest);
  Writer writer(*this);
  remove_orphans(writer.db(), digests);
}

bool SqliteStore::commit_artifacts(const Claim& claim, const std::vector<ArtifactRecord>& artifacts,
                                   const std::string& accuracy_json) {
  if (claim.type != TaskType::assemble) return false;
  Writer writer(*this);
  Database& db = writer.db();
  if (!holds(db, claim)) return false;
  for (size_t i = 0; i < artifacts.size(); ++i) {
    const ArtifactRecord& artifact = artifacts[i];
    // Equal bytes of a job that was removed meanwhile.
    if (!blobs_.has(artifact.digest))
      throw Error(ErrorCode::unavailable, "An artifact was removed before the result was whole.");
    db.run("INSERT INTO artifacts VALUES(?1,?2,?3,?4,?5,?6,?7)", claim.job_id, i, artifact.name,
           artifact.role, artifact.media_type, artifact.digest, artifact.bytes);
    add_event(db, claim.job_id, "artifact",
              EventJson()
                  .text("name", artifact.name)
                  .text("role", artifact.role)
                  .text("media_type", artifact.media_type)
                  .text("digest", artifact.digest)
                  .count("bytes", artifact.bytes)
                  .take());
  }
  db.run("UPDATE documents SET accuracy_json=?2 WHERE job_id=?1", claim.job_id, accuracy_json);
  db.run("UPDATE tasks SET state=2, lease=0, worker='' WHERE job_id=?1 AND type=?2", claim.job_id,
         static_cast<int>(TaskType::assemble));
  move_job(db, claim.job_id, JobEvent::result_committed, "");
  std::vector<std::string> orphans;
  drop_chunk_bytes(db, claim.job_id, &orphans);
  writer.commit();
  remove_orphans(db, orphans);
  return true;
}

}  // namespace lightkiln
