#pragma once

// What may end a wait: Ctrl-C and --timeout.

#include <chrono>

namespace lightkiln::cli {

class Attention {
 public:
  // Catches SIGINT from here on; `timeout_s` 0 = none. One at a time.
  explicit Attention(double timeout_s);
  ~Attention();
  Attention(const Attention&) = delete;
  Attention& operator=(const Attention&) = delete;

  static int interrupts();  // Ctrl-C since the last one was made
  bool timed_out() const;
  // Whether calls should end now. Nothing ends them while muted.
  bool wanted() const { return !muted_ && (interrupts() > 0 || timed_out()); }
  void mute() { muted_ = true; }

 private:
  std::chrono::steady_clock::time_point deadline_;
  bool limited_;
  bool muted_ = false;
};

}  // namespace lightkiln::cli
