#pragma once

// What an oven gives up before it looks at a client's file. Every layer stands alone; a kernel that
// lacks one leaves the others, and the missing one is reported by name, never passed over.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lightkiln {

struct SandboxOptions {
  uint64_t memory_bytes = 0;  // address space; 0 = no limit
};

struct SandboxLayer {
  const char* name;
  const char* meaning;  // for people: what the oven cannot do any more
  bool (*enter)(const SandboxOptions& options);
  // False: the runtime of a sanitizer cannot live in it (it maps terabytes of shadow memory, reads
  // /proc/self/maps and traces its own process), so that a build with one leaves it out.
  bool with_sanitizers;
};

// In the order in which they are entered: "oom_score", "limits", "address_space", "namespaces",
// "parent_death", "no_new_privileges", "landlock", "seccomp".
std::span<const SandboxLayer> sandbox_layers();

// The layer of this name; null when there is none.
const SandboxLayer* find_sandbox_layer(std::string_view name);

// Enters every layer. Call it before the first thread starts. Returns the names of those that could
// not be had, among them those that a build with a sanitizer leaves out.
std::vector<std::string> enter_sandbox(const SandboxOptions& options);

}  // namespace lightkiln
