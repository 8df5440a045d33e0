#pragma once

// Names of jobs: 26 characters of Crockford's base 32, 48 bits of Unix milliseconds and 80 random
// ones, so that sorting by name sorts by submission.

#include <cstdint>
#include <string>

namespace lightkiln {

// An id above `last` ("" = none yet), also when the clock stood still or stepped back.
std::string make_job_id(int64_t unix_ms, const std::string& last);

// `bytes` random bytes as hexadecimal text.
std::string random_hex(int bytes);

}  // namespace lightkiln
