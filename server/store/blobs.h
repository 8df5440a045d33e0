#pragma once

// The content-addressed directory: <root>/<first two digits>/<64 digits>. A file appears under its
// name only complete and durable: temporary file, write, fsync, rename, fsync of the folder.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include "proto/digest.h"

namespace lightkiln {

inline constexpr int kBlobShards = 256;

class Blobs {
 public:
  // Makes the folders and sweeps temporary files that dead processes left.
  explicit Blobs(const std::string& root);

  // A temporary file that is hashed while it is written; removed unless it was kept.
  class Draft {
   public:
    explicit Draft(Blobs& blobs);
    ~Draft();
    Draft(const Draft&) = delete;
    Draft& operator=(const Draft&) = delete;
    // Throws Error{unavailable} when the disk is full.
    void append(const void* data, size_t size);
    // Ends the writing and returns the digest.
    std::string finish();
    // Makes the bytes durable under their digest, replacing a file that this process has not
    // verified: it may be damaged. False when there was one already.
    bool keep();

   private:
    friend class Blobs;
    void write(const void* data, size_t size);  // without hashing it
    Blobs& blobs_;
    std::string path_, digest_;
    int fd_ = -1;
    Sha256 hash_;
  };

  std::string put(std::span<const std::byte> bytes);
  // The same for bytes whose digest is known: hashing is most of what a large blob costs.
  void put(std::span<const std::byte> bytes, const std::string& digest);
  // Throws Error{invalid_input} unless `digest` reads "sha256:<64 lower-case hex>".
  bool has(const std::string& digest) const;
  // As Store::open_blob.
  int open(const std::string& digest, uint64_t* size);
  // Whole contents, verified on every read.
  std::string read(const std::string& digest);
  void remove(const std::string& digest);
  // Digest and bytes of every blob that was written before `unix_ms` and whose first two digits are
  // `shard`, 0 to 255.
  std::vector<std::pair<std::string, uint64_t>> older_than(int64_t unix_ms, int shard) const;

 private:
  // Present, found whole by this process, and durable under its name.
  bool has_verified(const std::string& digest);
  std::string path_of(const std::string& digest) const;
  void quarantine(const std::string& digest);

  std::string root_;
  std::string draft_prefix_;
  std::mutex mutex_;
  std::unordered_set<std::string> verified_;
  uint64_t drafts_ = 0;
};

}  // namespace lightkiln
