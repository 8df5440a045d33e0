#include "server/store/blobs.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/store/job_id.h"
#include "server/store/process_identity.h"
#include "server/store/refusal.h"
#include "server/store/storage_failure.h"

namespace lightkiln {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kPrefix = "sha256:";
constexpr size_t kPiece = 1u << 20;

std::string shard_name(int shard) {
  return {'/', "0123456789abcdef"[shard >> 4], "0123456789abcdef"[shard & 15]};
}

std::string_view hex_of(std::string_view digest) {
  const bool good =
      digest.size() == kPrefix.size() + 64 && digest.substr(0, kPrefix.size()) == kPrefix &&
      digest.find_first_not_of("0123456789abcdef", kPrefix.size()) == std::string_view::npos;
  if (!good)
    throw Error(ErrorCode::invalid_input,
                "A digest must read 'sha256:' and 64 lower-case hexadecimal digits.");
  return digest.substr(kPrefix.size());
}

// By errno.
[[noreturn]] void refuse_to_write(const std::string& what) {
  const std::string sentence = what + ": " + std::strerror(errno) + ".";
  if (errno == ENOSPC || errno == EDQUOT) throw StoreRefusal(kStorageFull, sentence);
  throw Error(ErrorCode::unavailable, sentence);
}

void fsync_folder(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) stop_for_storage_failure("opening the folder " + path);
  fsync_or_stop(fd, path);
  close(fd);
}

// Temporary names: their maker's identity with slashes replaced, '+', what makes them unique.
std::string make_draft_prefix() {
  std::string identity = own_process_identity();
  for (char& c : identity)
    if (c == '/') c = '_';
  return identity + "+" + random_hex(8) + ".";
}

void sweep_drafts(const fs::path& folder) {
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    std::string name = entry.path().filename().string();
    name.resize(name.rfind('+') == std::string::npos ? 0 : name.rfind('+'));
    for (char& c : name)
      if (c == '_') c = '/';
    std::error_code gone_already;
    if (is_provably_dead(name)) fs::remove(entry.path(), gone_already);
  }
}

}  // namespace

Blobs::Blobs(const std::string& root) : root_(root), draft_prefix_(make_draft_prefix()) {
  fs::create_directories(root_ + "/incoming");
  fs::create_directories(root_ + "/quarantine");
  for (int shard = 0; shard < kBlobShards; ++shard) fs::create_directory(root_ + shard_name(shard));
  fsync_folder(root_);
  sweep_drafts(root_ + "/incoming");
}

Blobs::Draft::Draft(Blobs& blobs) : blobs_(blobs) {
  {
    const std::lock_guard lock(blobs_.mutex_);
    path_ = blobs_.root_ + "/incoming/" + blobs_.draft_prefix_ + std::to_string(++blobs_.drafts_);
  }
  fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd_ < 0) refuse_to_write("The store cannot make a file");
}

Blobs::Draft::~Draft() {
  if (fd_ >= 0) close(fd_);
  if (!path_.empty()) unlink(path_.c_str());
}

void Blobs::Draft::append(const void* data, size_t size) {
  hash_.append(data, size);
  write(data, size);
}

void Blobs::Draft::write(const void* data, size_t size) {
  const char* next = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(fd_, next, size);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) refuse_to_write("The store cannot write");
    next += written;
    size -= static_cast<size_t>(written);
  }
}

std::string Blobs::Draft::finish() {
  if (digest_.empty()) digest_ = hash_.digest();
  return digest_;
}

bool Blobs::Draft::keep() {
  finish();
  if (blobs_.has_verified(digest_)) return false;
  const bool known = blobs_.has(digest_);
  fsync_or_stop(fd_, path_);
  const std::string final_path = blobs_.path_of(digest_);
  if (rename(path_.c_str(), final_path.c_str()) != 0)
    stop_for_storage_failure("renaming to " + final_path);
  path_.clear();
  fsync_folder(fs::path(final_path).parent_path().string());
  const std::lock_guard lock(blobs_.mutex_);
  blobs_.verified_.insert(digest_);
  return !known;
}

std::string Blobs::put(std::span<const std::byte> bytes) {
  Sha256 hash;
  hash.append(bytes.data(), bytes.size());
  std::string digest = hash.digest();
  put(bytes, digest);
  return digest;
}

void Blobs::put(std::span<const std::byte> bytes, const std::string& digest) {
  if (has_verified(digest)) return;
  Draft draft(*this);
  draft.write(bytes.data(), bytes.size());
  draft.digest_ = digest;
  draft.keep();
}

std::string Blobs::path_of(const std::string& digest) const {
  const std::string hex(hex_of(digest));
  return root_ + "/" + hex.substr(0, 2) + "/" + hex;
}

bool Blobs::has(const std::string& digest) const {
  return access(path_of(digest).c_str(), F_OK) == 0;
}

// Whoever renamed the file may not have reached its fsync of the folder yet, so that is done here
// as well before anything is acknowledged that refers to it.
bool Blobs::has_verified(const std::string& digest) {
  {
    const std::lock_guard lock(mutex_);
    if (!verified_.contains(digest)) return false;
  }
  if (!has(digest)) return false;
  fsync_folder(fs::path(path_of(digest)).parent_path().string());
  return true;
}

int Blobs::open(const std::string& digest, uint64_t* size) {
  const int fd = ::open(path_of(digest).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  struct stat info {};
  if (fd < 0 || fstat(fd, &info) != 0) {
    if (fd >= 0) close(fd);
    throw Error(ErrorCode::not_found, "There is no blob " + digest + ".");
  }
  if (size) *size = static_cast<uint64_t>(info.st_size);
  {
    const std::lock_guard lock(mutex_);
    if (verified_.contains(digest)) return fd;
  }
  Sha256 hash;
  std::vector<char> piece(kPiece);
  off_t offset = 0;
  ssize_t got = 0;
  while ((got = pread(fd, piece.data(), piece.size(), offset)) > 0) {
    hash.append(piece.data(), static_cast<size_t>(got));
    offset += got;
  }
  if (got < 0 || hash.digest() != digest) {
    close(fd);
    quarantine(digest);
    throw Error(ErrorCode::internal,
                "The stored blob " + digest + " no longer matches its digest; it was set aside.");
  }
  const std::lock_guard lock(mutex_);
  verified_.insert(digest);
  return fd;
}

std::string Blobs::read(const std::string& digest) {
  uint64_t size = 0;
  const int fd = open(digest, &size);
  std::string bytes(size, '\0');
  size_t done = 0;
  while (done < size) {
    const ssize_t got = pread(fd, bytes.data() + done, size - done, static_cast<off_t>(done));
    if (got <= 0) break;
    done += static_cast<size_t>(got);
  }
  close(fd);
  Sha256 hash;
  hash.append(bytes.data(), done);
  if (done != size || hash.digest() != digest) {
    quarantine(digest);
    throw Error(ErrorCode::internal,
                "The stored blob " + digest + " no longer matches its digest; it was set aside.");
  }
  return bytes;
}

void Blobs::remove(const std::string& digest) {
  unlink(path_of(digest).c_str());
  const std::lock_guard lock(mutex_);
  verified_.erase(digest);
}

std::vector<std::pair<std::string, uint64_t>> Blobs::older_than(int64_t unix_ms, int shard) const {
  std::vector<std::pair<std::string, uint64_t>> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(root_ + shard_name(shard))) {
    struct stat info {};
    const std::string name = entry.path().filename().string();
    if (name.size() != 64 || lstat(entry.path().c_str(), &info) != 0 || !S_ISREG(info.st_mode))
      continue;
    const int64_t written_ms =
        static_cast<int64_t>(info.st_mtim.tv_sec) * 1000 + info.st_mtim.tv_nsec / 1'000'000;
    if (written_ms < unix_ms)
      found.emplace_back(std::string(kPrefix) + name, static_cast<uint64_t>(info.st_size));
  }
  return found;
}

void Blobs::quarantine(const std::string& digest) {
  const std::string aside = root_ + "/quarantine/" + std::string(hex_of(digest));
  rename(path_of(digest).c_str(), aside.c_str());
  const std::lock_guard lock(mutex_);
  verified_.erase(digest);
}

}  // namespace lightkiln
