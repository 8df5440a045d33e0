#pragma once

// One oven as a child process: started, spoken to, ended, and what became of it in one sentence.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "server/oven/frames.h"

namespace lightkiln {

struct OvenOptions {
  std::string path;
  uint64_t memory_bytes = 0;  // a job's; 0 = no limit
  // Address space is not memory: code, thread stacks and malloc's reserves take their share of it.
  uint64_t address_space_besides = 2ull << 30;
};

// How an oven ended. `code` is "oven_crashed" or "out_of_memory".
struct OvenDeath {
  std::string code;
  std::string sentence;
};

class OvenProcess {
 public:
  // Starts the program with an empty environment; the kernel kills it when the calling thread ends.
  // `interrupted` is asked while waiting for it. Throws Error{unavailable} when it cannot be
  // started.
  OvenProcess(const OvenOptions& options, std::function<bool()> interrupted);
  // Kills and reaps it.
  ~OvenProcess();
  OvenProcess(const OvenProcess&) = delete;
  OvenProcess& operator=(const OvenProcess&) = delete;

  Channel& channel() { return *channel_; }
  pid_t pid() const { return pid_; }
  bool ended() const;  // dead, and not yet reaped
  // Asks the work in hand to stop and gives it `grace_ms` to do so; then kills it.
  void stop(int grace_ms);
  // After its pipe broke: reaps it and tells why it ended.
  OvenDeath bury();

 private:
  pid_t pid_ = -1;
  std::unique_ptr<Channel> channel_;
  uint64_t oom_kills_before_ = 0;
};

}  // namespace lightkiln
