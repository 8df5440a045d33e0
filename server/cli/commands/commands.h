#pragma once

// kiln's verbs. Data goes to stdout, talk to stderr.

#include "server/cli/commands/arguments.h"
#include "server/cli/commands/exit_code.h"
#include "server/cli/commands/session.h"

namespace lightkiln::cli {

// Parses the line, runs the verb, and turns every error into a sentence and an exit code.
int run(int argc, const char* const* argv);

// bake.cpp
ExitCode bake(const Arguments& arguments);
ExitCode submit(const Arguments& arguments);
// jobs.cpp
ExitCode wait(const Arguments& arguments);
ExitCode fetch(const Arguments& arguments);
ExitCode ls(const Arguments& arguments);
ExitCode show(const Arguments& arguments);
ExitCode cancel(const Arguments& arguments);
// plan.cpp
ExitCode plan(const Arguments& arguments);
// view.cpp
ExitCode view(const Arguments& arguments);
// run.cpp
ExitCode version(const Arguments& arguments);

// --- steps they share ---------------------------------------------------------------------------

// Reads the order file, has it checked, and uploads what the server lacks. Gives the request body.
std::string prepare_order(Session& session);
// An Idempotency-Key. With a private daemon it follows from the request, so that the same command
// goes on with the same job.
std::string submission_key(const Session& session, const std::string& request_json);
// A private job of an earlier command that failed or was cancelled then is queued again, unless
// the order or its files were at fault: the same bytes would fail the same way.
JobMessage revive(Session& session, const SubmitAnswer& answer);

// Downloads into --output what is not there with the right bytes already; `only` empty = all.
// Throws Error{not_found} for a name that the job has not.
std::vector<ArtifactMessage> fetch_artifacts(Session& session, const JobMessage& job,
                                             const std::vector<std::string>& only);
// The table of artifacts with error and time.
void print_result(const JobMessage& job, const std::vector<ArtifactMessage>& artifacts);

}  // namespace lightkiln::cli
