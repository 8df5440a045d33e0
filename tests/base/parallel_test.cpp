#include "core/base/parallel.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>

namespace lightkiln {
namespace {

constexpr size_t kBlocks = 64;

// Address space that this process uses, in bytes.
rlim_t address_space() {
  unsigned long pages = 0;
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (!file || std::fscanf(file, "%lu", &pages) != 1) std::abort();
  std::fclose(file);
  return pages * 4096;
}

// Runs a loop for 64 threads where there is room for the stacks of a few, and ends the process: 0
// when every block was done once.
[[noreturn]] void run_short_of_threads() {
  const rlim_t room = address_space() + (rlim_t{64} << 20);
  const rlimit limit{room, room};
  if (setrlimit(RLIMIT_AS, &limit) != 0) std::_Exit(2);
  std::vector<std::atomic<int>> visits(kBlocks);
  std::atomic<size_t> busy{0}, most{0};
  Progress progress;
  parallel_blocks(kBlocks, 1, kBlocks, progress, [&](size_t begin, size_t) {
    const size_t now = ++busy;
    size_t seen = most;
    while (now > seen && !most.compare_exchange_weak(seen, now)) {
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    ++visits[begin];
    --busy;
  });
  if (most == kBlocks) std::_Exit(3);  // every thread started: nothing was tested
  for (const auto& visit : visits)
    if (visit != 1) std::_Exit(4);
  std::_Exit(0);
}

TEST(ParallelDeathTest, ThreadsThatCannotStartLeaveTheirWorkToOthers) {
  EXPECT_EXIT(run_short_of_threads(), testing::ExitedWithCode(0), "");
}

TEST(Parallel, CoversEveryItemOnceWithAnyNumberOfThreads) {
  for (const int threads : {0, 1, 2, 7}) {
    std::vector<std::atomic<int>> visits(103);
    Progress progress;
    parallel_blocks(visits.size(), 10, threads, progress, [&](size_t begin, size_t end) {
      EXPECT_LE(end - begin, 10u);
      for (size_t i = begin; i < end; ++i) ++visits[i];
    });
    for (const auto& visit : visits) EXPECT_EQ(visit, 1);
  }
}

TEST(Parallel, TheFirstExceptionEndsTheLoopAndReachesTheCaller) {
  for (const int threads : {1, 4}) {
    std::atomic<int> done{0};
    Progress progress;
    EXPECT_THROW(parallel_blocks(100000, 1, threads, progress,
                                 [&](size_t begin, size_t) {
                                   if (begin == 3) throw std::runtime_error("three");
                                   ++done;
                                 }),
                 std::runtime_error);
    EXPECT_LT(done, 100000);
  }
}

TEST(Parallel, AGrantOfZeroIsOneThreadAProcessor) {
  EXPECT_EQ(granted_threads(3), 3);
  EXPECT_EQ(granted_threads(0),
            static_cast<int>(std::max(1u, std::thread::hardware_concurrency())));
}

}  // namespace
}  // namespace lightkiln
