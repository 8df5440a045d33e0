#include "server/worker/heartbeat.h"

#include <algorithm>
#include <chrono>

#include "core/base/parallel.h"

namespace lightkiln {

namespace {

constexpr int64_t kLookEveryMs = 100;       // for a cancel: a read only
constexpr int64_t kProgressEveryMs = 1000;  // a write, so that clients see progress

int64_t now_ms() {
  return static_cast<int64_t>(wall_seconds() * 1000);
}

}  // namespace

Heartbeat::Heartbeat(Store& store, const Claim& claim, int64_t lease_ms)
    : store_(store), claim_(claim), lease_ms_(lease_ms), thread_([this] { run(); }) {}

Heartbeat::~Heartbeat() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  thread_.join();
}

// A store that cannot be reached is not a lost lease yet; two thirds into an unrenewed lease it is
// treated as one, so that this oven has ended before another may begin.
bool Heartbeat::still_ours(int64_t* beat_at_ms, int64_t* known_good_ms) {
  try {
    if (!store_.holds_lease(claim_)) return false;
    if (now_ms() >= *beat_at_ms) {
      *beat_at_ms = now_ms() + std::min(lease_ms_ / 3, kProgressEveryMs);
      if (!store_.heartbeat(claim_, fraction_.load())) return false;
      *known_good_ms = now_ms();
    }
    return true;
  } catch (const Error&) {
    return now_ms() - *known_good_ms < lease_ms_ * 2 / 3;
  }
}

void Heartbeat::run() {
  int64_t known_good_ms = now_ms();
  int64_t beat_at_ms = known_good_ms + std::min(lease_ms_ / 3, kProgressEveryMs);
  const int64_t look_ms = std::clamp<int64_t>(lease_ms_ / 6, 1, kLookEveryMs);
  std::unique_lock lock(mutex_);
  while (!ended_.wait_for(lock, std::chrono::milliseconds(look_ms), [this] { return end_; })) {
    lock.unlock();
    const bool ours = still_ours(&beat_at_ms, &known_good_ms);
    lock.lock();
    if (!ours) {
      lost_.store(true);
      return;
    }
  }
}

}  // namespace lightkiln
