// Blobs that nobody needs any more: what remains of uploads that were never ordered with, of jobs
// that were removed, and of processes that died between writing a file and referring to it.
//
// Whether a blob is needed is judged by the wall clock, because its age outlives a boot. A clock
// that jumps ahead makes unused blobs go early; a client then sends them again. A blob that a job
// refers to is never judged by age.

#include <algorithm>

#include "server/store/sqlite_store.h"

namespace lightkiln {

namespace {

// Files removed under one lock: others that write wait so long.
constexpr size_t kBatch = 32;
// An upload is noted as used anew once its note is so old: asking again and again writes nothing.
constexpr int64_t kUseNoteMs = 3600 * 1000;

}  // namespace

std::vector<std::string> SqliteStore::missing_blobs(const std::vector<std::string>& digests) {
  std::vector<std::string> missing, to_note;
  {
    ReadAccess read(*this);
    const int64_t fresh_ms = wall_clock_ms() - kUseNoteMs;
    for (const std::string& digest : digests) {
      if (!blobs_.has(digest))
        missing.push_back(digest);
      else if (!was_used_since(read.db(), digest, fresh_ms))
        to_note.push_back(digest);
    }
  }
  if (to_note.empty()) return missing;
  Writer writer(*this);
  for (const std::string& digest : to_note) {
    if (!blobs_.has(digest)) {
      missing.push_back(digest);  // it went in between
      continue;
    }
    writer.db().run(
        "INSERT INTO uploads(digest,used_ms) VALUES(?1,?2) ON CONFLICT(digest) DO UPDATE SET "
        "used_ms=?2",
        digest, wall_clock_ms());
  }
  writer.commit();
  return missing;
}

// First the note of the upload goes, then the file, both under the lock: a crash between the two
// leaves a file without a note, which the next call takes. Whoever begins to refer to a blob looks
// for its file under the same lock.
Collected SqliteStore::collect_unused(int64_t unused_ms, const std::function<bool()>& stop) {
  Collected collected;
  const auto needed = [&](Database& db, const std::string& digest) {
    return was_used_since(db, digest, wall_clock_ms() - unused_ms) || is_referred_to(db, digest);
  };
  for (int shard = 0; shard < kBlobShards; ++shard) {
    if (stop && stop()) break;
    auto old = blobs_.older_than(wall_clock_ms() - unused_ms, shard);
    {
      ReadAccess read(*this);
      std::erase_if(old, [&](const auto& blob) { return needed(read.db(), blob.first); });
    }
    for (size_t first = 0; first < old.size() && !(stop && stop()); first += kBatch) {
      Writer writer(*this);
      Database& db = writer.db();
      std::vector<std::pair<std::string, uint64_t>> batch(
          old.begin() + static_cast<std::ptrdiff_t>(first),
          old.begin() + static_cast<std::ptrdiff_t>(std::min(first + kBatch, old.size())));
      std::erase_if(batch, [&](const auto& blob) { return needed(db, blob.first); });
      Collected more;
      for (const auto& [digest, bytes] : batch) {
        db.run("DELETE FROM uploads WHERE digest=?1", digest);
        more.blobs += 1;
        more.bytes += bytes;
      }
      db.run("UPDATE counters SET value=value+?1 WHERE name='collected_blobs'", more.blobs);
      db.run("UPDATE counters SET value=value+?1 WHERE name='collected_bytes'", more.bytes);
      writer.commit();
      for (const auto& [digest, bytes] : batch) blobs_.remove(digest);
      collected.blobs += more.blobs;
      collected.bytes += more.bytes;
    }
  }
  return collected;
}

}  // namespace lightkiln
