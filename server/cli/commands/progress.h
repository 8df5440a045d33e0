#pragma once

// A job's progress on stderr: one live line on a terminal, plain lines elsewhere.

#include <chrono>
#include <string>

#include "proto/messages.h"

namespace lightkiln::cli {

class ProgressDisplay {
 public:
  // `quiet` shows nothing.
  explicit ProgressDisplay(bool quiet);
  ~ProgressDisplay() { clear(); }
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  // Off a terminal: a line at every change of state or stage, and at most every 30 s.
  void show(const JobMessage& job);
  // Takes the live line away.
  void clear();

 private:
  bool quiet_;
  bool terminal_;
  bool shown_ = false;
  std::string last_state_;
  std::chrono::steady_clock::time_point last_line_;
};

// "bake 42 %, 12 of 28 chunks, error 0.031 of 0.02, 12 s left"
std::string progress_sentence(const JobMessage& job);

}  // namespace lightkiln::cli
