#pragma once

// The baking end of the pipe: loads one job, answers for its plan, chunks and result, and ends.

#include <string>
#include <vector>

#include "server/oven/frames.h"

namespace lightkiln {

// Serves one job over `channel` until the worker hangs up (returns 0) or an error was sent (1).
// `missing_layers` is what enter_sandbox() returned.
int serve_oven(Channel& channel, const std::vector<std::string>& missing_layers);

}  // namespace lightkiln
