#include "server/store/storage_failure.h"

#include <cerrno>
#include <cstring>

#include <unistd.h>

namespace lightkiln {

void stop_for_storage_failure(const std::string& what) {
  const std::string line = "storage failed: " + what + ": " + std::strerror(errno) +
                           "; stopping, because what was written last may be lost\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, line.data(), line.size());
  _exit(kExitStorageFailed);
}

void fsync_or_stop(int fd, const std::string& what) {
  if (fsync(fd) != 0) stop_for_storage_failure("fsync of " + what);
}

}  // namespace lightkiln
