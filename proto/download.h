#pragma once

// A file that arrives in pieces, perhaps over several connections, and becomes visible only when
// its digest was checked.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "proto/digest.h"

namespace lightkiln {

class PartFile {
 public:
  // Goes on with "<target>.part" where one stands that is not longer than `bytes`.
  PartFile(const std::filesystem::path& target, uint64_t bytes);

  uint64_t size() const { return size_; }
  bool complete() const { return size_ == bytes_; }
  bool overrun() const { return overrun_; }  // more bytes came than were promised
  // False, and overrun() from then on, when the piece would pass the promised size.
  bool append(const char* data, size_t size);
  // Empties the part. Always true.
  bool restart();
  // Checks the digest and moves the part to its target; throws DigestMismatch and removes the part.
  void finish(const std::string& digest, const std::string& name);

 private:
  std::filesystem::path target_, part_;
  uint64_t bytes_;
  uint64_t size_ = 0;
  bool overrun_ = false;
  Sha256 hash_;
  std::ofstream file_;
};

}  // namespace lightkiln
