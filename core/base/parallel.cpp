#include "core/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include <immintrin.h>
#include <time.h>

namespace lightkiln {

namespace {

constexpr unsigned int kFlushToZero = 0x8000;
constexpr unsigned int kDenormalsAreZero = 0x0040;

double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

FlushDenormals::FlushDenormals() : saved_(_mm_getcsr()) {
  _mm_setcsr(saved_ | kFlushToZero | kDenormalsAreZero);
}
FlushDenormals::~FlushDenormals() {
  _mm_setcsr(saved_);
}

double thread_cpu_seconds() {
  return seconds(CLOCK_THREAD_CPUTIME_ID);
}
double process_cpu_seconds() {
  return seconds(CLOCK_PROCESS_CPUTIME_ID);
}
double wall_seconds() {
  return seconds(CLOCK_MONOTONIC);
}

int granted_threads(int threads) {
  if (threads > 0) return threads;
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

void parallel_blocks(size_t count, size_t block, int threads, Progress& progress,
                     const std::function<void(size_t, size_t)>& body, double progress_begin,
                     double progress_end) {
  if (count == 0) return;
  block = std::max<size_t>(block, 1);
  const size_t blocks = (count + block - 1) / block;
  const size_t workers = std::min(static_cast<size_t>(granted_threads(threads)), blocks);

  std::atomic<size_t> next{0};
  std::atomic<size_t> done{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::exception_ptr failure;

  const auto run = [&] {
    const FlushDenormals guard;
    for (;;) {
      const size_t index = next.fetch_add(1);
      if (index >= blocks || stop.load()) return;
      try {
        progress.check();
        body(index * block, std::min(count, (index + 1) * block));
        const std::lock_guard lock(mutex);
        const double share =
            static_cast<double>(done.fetch_add(1) + 1) / static_cast<double>(blocks);
        progress.update(progress_begin + (progress_end - progress_begin) * share);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        stop.store(true);
        return;
      }
    }
  };

  {
    std::vector<std::jthread> pool;  // joins at the end of this block, however it is left
    pool.reserve(workers - 1);
    try {
      for (size_t i = 1; i < workers; ++i) pool.emplace_back(run);
    } catch (const std::system_error&) {
      // The system has no more threads to give. Those that started and the caller do all blocks.
    }
    run();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace lightkiln
