#pragma once

// Starts worker processes and starts them again when they end, sooner the longer they lived.

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "server/http/log.h"

namespace lightkiln {

class Supervisor {
 public:
  // `command`: program and arguments of worker `i`; its environment and standard error are ours.
  // Workers get our process number as `--parent` and end when this process does.
  Supervisor(Log& log, std::vector<std::vector<std::string>> commands);
  ~Supervisor();  // stop(0)
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  // SIGTERM to all, without waiting; none is started again.
  void begin_stop();
  // Waits up to `grace_ms` for them to end, then SIGKILL.
  void stop(int64_t grace_ms);
  // Process numbers of those that run.
  std::vector<pid_t> processes() const;

 private:
  struct Child {
    std::vector<std::string> command;
    pid_t process = 0;  // 0: not running
    std::chrono::steady_clock::time_point started, start_at;
    int failures = 0;
  };
  void watch();
  void start(Child& child);
  void reap(Child& child);

  Log& log_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Child> children_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace lightkiln
