#pragma once

// What a script can tell from kiln's exit.

#include "core/base/error.h"

namespace lightkiln::cli {

enum ExitCode : int {
  kSucceeded = 0,
  kFailed = 1,          // the job failed, or something else went wrong
  kUsage = 2,           // the command line
  kInvalidOrder = 3,    // the spec or an input was refused
  kUnauthorized = 4,    // no token, a wrong one, or one without the right
  kCancelled = 5,       // the job was cancelled
  kGateMissed = 6,      // the result's error is above --max-error
  kUnreachable = 7,     // no server after all tries
  kNotFound = 8,        // no such job or artifact
  kDigestMismatch = 9,  // an artifact arrived with other bytes
  kTimedOut = 124,      // --timeout passed; the job goes on unless --cancel-on-timeout
  kInterrupted = 130,   // Ctrl-C
};

ExitCode exit_code(const Error& error);

}  // namespace lightkiln::cli
