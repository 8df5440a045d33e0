#pragma once

// After a failed fsync the kernel may have dropped the dirty pages, and a second fsync can then
// "succeed" without them. No retry is honest: the process stops, and what it acknowledged before is
// read back from disk by the next one.

#include <string>

namespace lightkiln {

// The exit code of a process that stopped because its disk could not keep a promise.
inline constexpr int kExitStorageFailed = 74;

// Says on stderr what failed and ends the process at once with kExitStorageFailed.
[[noreturn]] void stop_for_storage_failure(const std::string& what);

// fsync of a descriptor; stops the process when it fails.
void fsync_or_stop(int fd, const std::string& what);

}  // namespace lightkiln
