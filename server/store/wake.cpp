#include "server/store/wake.h"

#include <algorithm>
#include <climits>

#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "core/base/error.h"

namespace lightkiln {

static_assert(std::atomic<uint32_t>::is_always_lock_free && sizeof(std::atomic<uint32_t>) == 4);

WakeFile::WakeFile(const std::string& path) {
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  void* memory = MAP_FAILED;
  if (fd >= 0 && ftruncate(fd, sizeof(uint32_t)) == 0)
    memory = mmap(nullptr, sizeof(uint32_t), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (fd >= 0) close(fd);
  if (memory == MAP_FAILED)
    throw Error(ErrorCode::unavailable, "The store's wake file '" + path + "' cannot be mapped.");
  counter_ = static_cast<std::atomic<uint32_t>*>(memory);
}

WakeFile::~WakeFile() {
  munmap(static_cast<void*>(counter_), sizeof(uint32_t));
}

void WakeFile::wake_all() {
  counter_->fetch_add(1, std::memory_order_acq_rel);
  syscall(SYS_futex, static_cast<void*>(counter_), FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

void WakeFile::wait(uint32_t seen, int64_t wait_ms) const {
  const int64_t slice_ms = std::clamp<int64_t>(wait_ms, 0, kPollMs);
  timespec timeout{};
  timeout.tv_nsec = static_cast<long>(slice_ms * 1'000'000);
  syscall(SYS_futex, static_cast<void*>(counter_), FUTEX_WAIT, seen, &timeout, nullptr, 0);
}

}  // namespace lightkiln
