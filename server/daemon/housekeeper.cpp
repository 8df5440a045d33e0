#include "server/daemon/housekeeper.h"

#include <algorithm>
#include <chrono>
#include <string_view>

namespace lightkiln {

namespace {

using Seconds = std::chrono::duration<double>;
constexpr double kFirstPause_s = 60;
constexpr double kLongestPause_s = 3600;

}  // namespace

Housekeeper::Housekeeper(Store& store, Log& log, double keep_unused_s) : store_(store), log_(log) {
  if (keep_unused_s > 0) thread_ = std::thread([this, keep_unused_s] { run(keep_unused_s); });
}

Housekeeper::~Housekeeper() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Housekeeper::run(double keep_unused_s) {
  const double every_s = std::min(kLongestPause_s, keep_unused_s / 10);
  double pause_s = std::min(kFirstPause_s, every_s);
  std::unique_lock lock(mutex_);
  while (!ended_.wait_for(lock, Seconds(pause_s), [this] { return end_; })) {
    lock.unlock();
    collect(keep_unused_s);
    lock.lock();
    pause_s = every_s;
  }
}

// A store that cannot be written now can be next time.
void Housekeeper::collect(double keep_unused_s) {
  const auto stop = [this] {
    const std::lock_guard lock(mutex_);
    return end_;
  };
  try {
    const Collected collected =
        store_.collect_unused(static_cast<int64_t>(keep_unused_s * 1000), stop);
    if (collected.blobs > 0)
      log_.write(LogLevel::info, "unused_blobs_removed",
                 {{"blobs", static_cast<int64_t>(collected.blobs)},
                  {"bytes", static_cast<int64_t>(collected.bytes)}});
  } catch (const std::exception& error) {
    log_.write(LogLevel::warning, "unused_blobs_kept",
               {{"detail", std::string_view(error.what())}});
  }
}

}  // namespace lightkiln
