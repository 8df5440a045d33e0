#pragma once

// Following a job to its end, and what its end means.

#include "server/cli/commands/session.h"

namespace lightkiln::cli {

// Shows progress until the job is terminal. On --timeout and Ctrl-C says how to come back and
// throws Exit; a second Ctrl-C within two seconds cancels the job.
JobMessage watch(Session& session, JobMessage job);

// Says on stderr why a job did not succeed, and checks --max-error of one that did.
ExitCode conclude(const JobMessage& job, const Arguments& arguments);

}  // namespace lightkiln::cli
