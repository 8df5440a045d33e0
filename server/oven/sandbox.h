#pragma once

// What an oven gives up before it looks at a client's file. Every layer stands alone; a kernel that
// lacks one leaves the others, and the missing one is reported by name, never passed over.

#include <cstdint>
#include <string>
#include <vector>

namespace lightkiln {

struct SandboxOptions {
  uint64_t memory_bytes = 0;  // address space; 0 = no limit
};

// In this order: out-of-memory preference, no core dumps, no new files, few descriptors, address
// space; user, network and IPC namespaces of its own; death with its parent; no new privileges;
// Landlock without any path; a list of allowed system calls, everything else answered with EPERM.
// Call it before the first thread starts. Returns the names of the layers that could not be had:
// "oom_score", "limits", "namespaces", "parent_death", "no_new_privileges", "landlock", "seccomp".
std::vector<std::string> enter_sandbox(const SandboxOptions& options);

}  // namespace lightkiln
