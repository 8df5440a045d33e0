#pragma once

// A daemon of kiln's own, on a free loopback port, for as long as kiln runs. So baking without a
// server is the same path through the code as baking with one.

#include <filesystem>
#include <string>

#include <sys/types.h>

#include "server/cli/commands/attention.h"

namespace lightkiln::cli {

struct PrivateDaemonOptions {
  std::filesystem::path store;  // made where it is not there
  int threads = 0;              // 0 = one per processor
};

class PrivateDaemon {
 public:
  // Starts `kilnd` (beside kiln, or what LIGHTKILN_KILND names) and waits until it listens. Another
  // kiln that uses the same store is waited for. Throws Error.
  PrivateDaemon(const PrivateDaemonOptions& options, const Attention& attention);
  // Asks it to stop, and insists after 10 s.
  ~PrivateDaemon();
  PrivateDaemon(const PrivateDaemon&) = delete;
  PrivateDaemon& operator=(const PrivateDaemon&) = delete;

  const std::string& url() const { return url_; }
  const std::filesystem::path& store() const { return store_; }

 private:
  void lock(const Attention& attention);
  void start(int threads);
  void wait_for_port(const Attention& attention);
  void stop();

  std::filesystem::path store_;
  std::string url_;
  int lock_ = -1;
  pid_t child_ = -1;
};

// ${XDG_CACHE_HOME:-~/.cache}/lightkiln/store
std::filesystem::path default_store();

}  // namespace lightkiln::cli
