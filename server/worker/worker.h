#pragma once

// A worker: claims tasks under a lease, hands them to its oven, keeps the lease alive, commits what
// comes back. It opens no client's file itself, and of a job's chunks and artifacts it holds one at
// a time and up to 64 MiB that wait to be written.

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

namespace lightkiln {

struct WorkerOptions {
  std::string store_directory;
  std::string oven_path;        // the program kiln-oven
  std::string name;             // for people; the lease holder's name adds random digits
  int threads = 0;              // of the oven; 0 = one per processor
  bool exit_when_idle = false;  // return as soon as nothing can be claimed
  uint64_t oven_memory_bytes = 4ull << 30;  // what a job may take; 0 = no limit
  int64_t lease_ms = 15000;                 // > 0
  double chunk_seconds = 4.0;               // work aimed at per chunk
  double task_seconds = 3600.0;             // wall time that one task may take
  // Layers of the oven's sandbox that this machine need not have: names of sandbox_layers(), or
  // "all".
  std::vector<std::string> allow_missing_sandbox;
  const std::atomic<bool>* stop = nullptr;  // besides SIGTERM and SIGINT; null = those only
};

// Runs until SIGTERM, SIGINT, `stop` or idleness; gives its claim back and ends its ovens first.
// Returns the exit code for the process: 0.
// A task that its oven could not finish fails with one of the codes of error_code_name, or
// "oven_crashed"; oven_crashed, out_of_memory and timed_out are tried again as the store allows.
// Throws Error when the store cannot be opened, no oven can be started, or its sandbox lacks a
// layer that is not allowed to be missing.
int run_worker(const WorkerOptions& options);

}  // namespace lightkiln
