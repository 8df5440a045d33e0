#pragma once

// What an operator sets, and the command line that sets it.

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/http/log.h"
#include "server/worker/worker.h"

namespace lightkiln {

struct ServeConfig {
  std::string store_directory;
  std::string host = "127.0.0.1";
  int port = 7420;         // 0 = a free one
  std::string port_file;   // written with the port once requests are taken; "" = none
  int workers = 1;         // processes that bake; 0 = none, jobs wait for workers started elsewhere
  int threads = 0;         // of each worker's oven; 0 = one per processor
  std::string token_file;  // "" = no tokens; needed for any address but loopback
  std::vector<std::string> hosts;  // names allowed in Host besides loopback ones and `host`
  bool parent_watch = false;       // stop when the parent process ends
  LogLevel log_level = LogLevel::info;
  int64_t lease_ms = 15000;
  uint64_t oven_memory_bytes = WorkerOptions().oven_memory_bytes;
  double chunk_seconds = WorkerOptions().chunk_seconds;
  double task_seconds = WorkerOptions().task_seconds;
  std::vector<std::string> allow_missing_sandbox;  // as WorkerOptions
  double keep_unused_days = 7;                     // blobs that no job refers to; 0 = for ever
  int max_connections = 256;
  int max_connections_per_address = 32;
  // The program started as `worker`, and the one that workers start as oven.
  std::string worker_program = "/proc/self/exe";
  std::string oven_path;  // "" = kiln-oven beside this program
};

// A `worker` ends when this process is no longer its parent; 0 = it does not look.
struct WorkerConfig {
  WorkerOptions options;
  int parent_process = 0;
};

// The command line asked for help or the version, or could not be read.
struct CommandLineEnd {
  int exit_code = 0;  // 0: the text was asked for; 2: it says what is wrong
  std::string text;
};
using Command = std::variant<ServeConfig, WorkerConfig, CommandLineEnd>;
Command parse_command_line(int argc, const char* const* argv);

// Throws Error{invalid_spec} when the settings contradict each other or are not safe: an address
// other than loopback without tokens.
void check(const ServeConfig& config);

// "host:port", "[::1]:port". Throws Error{invalid_spec}.
void parse_listen(const std::string& text, ServeConfig& config);

// kiln-oven in the folder of the running program.
std::string default_oven_path();

}  // namespace lightkiln
