#pragma once

// The serving process as an object that a test can own: make it (which opens the store and takes
// requests), use its port, stop it.

#include <memory>

#include "server/daemon/config.h"

namespace lightkiln {

class Daemon {
 public:
  // Throws Error when the settings are refused, the store cannot be opened or the address is taken.
  explicit Daemon(const ServeConfig& config);
  ~Daemon();  // stop()
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  int port() const;
  // Process numbers of the workers that run.
  std::vector<int> workers() const;
  // Stops accepting, ends waiting requests, gives the others 5 s and the workers 10 s.
  void stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Runs a daemon until SIGTERM or SIGINT, or with `parent_watch` until the parent process ends. A
// second signal ends everything at once. Gives the exit code.
int serve(const ServeConfig& config);

}  // namespace lightkiln
