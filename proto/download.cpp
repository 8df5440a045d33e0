#include "proto/download.h"

#include <vector>

#include "proto/client.h"

namespace lightkiln {

namespace fs = std::filesystem;

PartFile::PartFile(const fs::path& target, uint64_t bytes)
    : target_(target), part_(target.string() + ".part"), bytes_(bytes) {
  std::ifstream before(part_, std::ios::binary);
  std::vector<char> buffer(1 << 16);
  while (before) {
    before.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash_.append(buffer.data(), static_cast<size_t>(before.gcount()));
    size_ += static_cast<uint64_t>(before.gcount());
  }
  if (size_ > bytes_) {
    restart();
    return;
  }
  file_.open(part_, std::ios::binary | std::ios::app);
  if (!file_) throw Error(ErrorCode::not_found, "Cannot write " + part_.string() + ".");
}

bool PartFile::restart() {
  file_.close();
  file_.clear();
  file_.open(part_, std::ios::binary | std::ios::trunc);
  if (!file_) throw Error(ErrorCode::not_found, "Cannot write " + part_.string() + ".");
  hash_ = Sha256();
  size_ = 0;
  return true;
}

bool PartFile::append(const char* data, size_t size) {
  if (size > bytes_ - size_) {
    overrun_ = true;
    return false;
  }
  file_.write(data, static_cast<std::streamsize>(size));
  if (!file_)
    throw Error(ErrorCode::internal, "Cannot write " + part_.string() + "; is the disk full?");
  hash_.append(data, size);
  size_ += size;
  return true;
}

void PartFile::finish(const std::string& digest, const std::string& name) {
  file_.close();
  if (!file_)
    throw Error(ErrorCode::internal, "Cannot write " + part_.string() + "; is the disk full?");
  if (overrun_ || hash_.digest() != digest) {
    fs::remove(part_);
    throw DigestMismatch("The artifact " + name + " arrived with other bytes than " + digest +
                         "; nothing was kept.");
  }
  fs::rename(part_, target_);
}

}  // namespace lightkiln
