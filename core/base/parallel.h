#pragma once

// Parallel loops whose results do not depend on the number of threads: each call of the body owns
// the slots of its block, and nothing is reduced across threads.

#include <cstddef>
#include <functional>

#include "core/base/progress.h"

namespace lightkiln {

// Sets flush-to-zero and denormals-are-zero on the calling thread for the guard's lifetime. Embree
// asks for it, and results must not depend on which thread computed them.
class FlushDenormals {
 public:
  FlushDenormals();
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned int saved_;
};

// The number of threads that a grant of `threads` means: itself above 0, else one per processor; at
// least 1.
int granted_threads(int threads);

// Calls body(begin, end) for consecutive blocks of at most `block` items that cover [0, count), on
// granted_threads(threads) threads (1 runs on the caller), or on as many of them as the system lets
// start. The first exception stops the loop and is rethrown on the caller. `progress` is asked
// before every block and told the share of blocks done, mapped to [progress_begin, progress_end].
void parallel_blocks(size_t count, size_t block, int threads, Progress& progress,
                     const std::function<void(size_t begin, size_t end)>& body,
                     double progress_begin = 0.0, double progress_end = 1.0);

// CPU seconds that the calling thread has used.
double thread_cpu_seconds();
// CPU seconds that the whole process has used, and seconds of a clock that never steps back.
double process_cpu_seconds();
double wall_seconds();

}  // namespace lightkiln
