#pragma once

// Keeps one claim's lease alive from a thread of its own, and learns there that the job was
// cancelled or the lease lost.

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/store/store.h"

namespace lightkiln {

class Heartbeat {
 public:
  Heartbeat(Store& store, const Claim& claim, int64_t lease_ms);
  ~Heartbeat();
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;

  void set_fraction(double fraction) { fraction_.store(fraction); }
  // True once the work is for nothing: stop at once.
  bool lost() const { return lost_.load(); }

 private:
  void run();
  bool still_ours(int64_t* beat_at_ms, int64_t* known_good_ms);

  Store& store_;
  const Claim claim_;
  const int64_t lease_ms_;
  std::atomic<double> fraction_{0};
  std::atomic<bool> lost_{false};
  std::mutex mutex_;
  std::condition_variable ended_;
  bool end_ = false;
  std::thread thread_;
};

}  // namespace lightkiln
