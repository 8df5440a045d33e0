#pragma once

// Names for requests: 16 hexadecimal digits that do not repeat within a process and are not
// guessable from one another between processes.

#include <string>

namespace lightkiln {

std::string make_request_id();

}  // namespace lightkiln
