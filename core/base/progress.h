#pragma once

// Progress and cancellation are one object: work asks it once per block of about 10 ms.

#include <atomic>
#include <functional>

#include "core/base/error.h"

namespace lightkiln {

class Progress {
 public:
  Progress() = default;
  // `on_update(fraction)` may be called from any thread, one call at a time per reporting loop;
  // returning false asks for cancellation.
  explicit Progress(std::function<bool(double)> on_update) : on_update_(std::move(on_update)) {}

  // Reports that `fraction` in [0, 1] of the work is done. Throws Error{cancelled} once cancelled.
  void update(double fraction) {
    if (on_update_ && !on_update_(fraction)) cancel();
    check();
  }
  void check() const {
    if (cancelled()) throw Error(ErrorCode::cancelled, "The bake was cancelled.");
  }
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

 private:
  std::function<bool(double)> on_update_;
  std::atomic<bool> cancelled_{false};
};

}  // namespace lightkiln
