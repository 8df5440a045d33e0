#pragma once

// What may be missing of an oven's sandbox on this machine: nothing, unless the operator says so.

#include <string>
#include <vector>

#include "server/worker/oven_process.h"

namespace lightkiln {

// Allows every layer to be missing.
inline constexpr const char* kAllLayers = "all";

// The layers that a freshly started oven says it lacks, in the order of sandbox_layers(). Throws
// Error{unavailable} when it does not greet within `wait_ms` (negative = for ever), PeerGone when
// it died.
std::vector<std::string> read_greeting(OvenProcess& oven, int wait_ms);

// Throws Error{unavailable} that names the layers which are missing and not `allowed`.
void require_sandbox(const std::vector<std::string>& missing,
                     const std::vector<std::string>& allowed);

// Starts an oven for its greeting alone; gives the missing layers, or throws as the two above do.
std::vector<std::string> try_sandbox(const std::string& oven_path,
                                     const std::vector<std::string>& allowed);

}  // namespace lightkiln
