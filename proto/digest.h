#pragma once

// SHA-256 of bytes that arrive piece by piece.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace lightkiln {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void append(const void* data, size_t size);
  // "sha256:<64 lower-case hex>". Call it once, last.
  std::string digest();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct FileDigest {
  std::string digest;
  uint64_t bytes = 0;
};
// Throws Error{not_found} when the file cannot be read.
FileDigest sha256_file(const std::filesystem::path& path);

}  // namespace lightkiln
