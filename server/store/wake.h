#pragma once

// A counter in a small shared file on which any process of this host can sleep until another one
// changes the store. It only saves waiting: who sleeps looks again every 200 ms at the latest, so a
// process that dies between its commit and its call costs no more than that.

#include <atomic>
#include <cstdint>
#include <string>

namespace lightkiln {

class WakeFile {
 public:
  static constexpr int64_t kPollMs = 200;

  explicit WakeFile(const std::string& path);
  ~WakeFile();
  WakeFile(const WakeFile&) = delete;
  WakeFile& operator=(const WakeFile&) = delete;

  uint32_t value() const { return counter_->load(std::memory_order_acquire); }
  void wake_all();
  // Returns when the counter differs from `seen` or after `wait_ms`, kPollMs at the most.
  void wait(uint32_t seen, int64_t wait_ms) const;

 private:
  std::atomic<uint32_t>* counter_ = nullptr;
};

}  // namespace lightkiln
