#include "server/cli/commands/watch.h"

#include <chrono>
#include <iostream>
#include <thread>

#include "server/cli/commands/progress.h"
#include "server/cli/commands/text.h"

namespace lightkiln::cli {
namespace {

// Short, so that Ctrl-C and the live line are never late; a job that ends is told at once.
constexpr int kWaitSeconds = 1;
constexpr auto kSecondInterrupt = std::chrono::seconds(2);

void cancel_remotely(Session& session, const std::string& id) {
  session.attention().mute();
  session.client().cancel(id);
  std::cerr << "kiln: The job " << id << " was cancelled.\n";
}

[[noreturn]] void leave_on_timeout(Session& session, const std::string& id) {
  std::cerr << "kiln: --timeout passed before the job " << id << " ended.\n";
  if (session.arguments().cancel_on_timeout)
    cancel_remotely(session, id);
  else
    std::cerr << session.reattach_hint(id) << '\n';
  throw Exit(kTimedOut);
}

[[noreturn]] void leave_on_interrupt(Session& session, const std::string& id) {
  std::cerr << "kiln: Interrupted. " << session.reattach_hint(id)
            << "\nPress Ctrl-C again to cancel the job.\n";
  const auto end = std::chrono::steady_clock::now() + kSecondInterrupt;
  while (std::chrono::steady_clock::now() < end) {
    if (session.attention().interrupts() > 1) {
      cancel_remotely(session, id);
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  throw Exit(kInterrupted);
}

}  // namespace

JobMessage watch(Session& session, JobMessage job) {
  ProgressDisplay display(session.arguments().quiet);
  while (!job.terminal) {
    display.show(job);
    try {
      if (session.attention().wanted()) throw Error(ErrorCode::cancelled, "The wait ended.");
      job = session.client().job(job.id, kWaitSeconds);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::cancelled || !session.attention().wanted()) throw;
      display.clear();
      if (session.attention().interrupts() > 0) leave_on_interrupt(session, job.id);
      leave_on_timeout(session, job.id);
    }
  }
  display.show(job);
  return job;
}

ExitCode conclude(const JobMessage& job, const Arguments& arguments) {
  if (job.state == "cancelled") {
    std::cerr << "kiln: The job " << printable(job.id) << " was cancelled.\n";
    return kCancelled;
  }
  if (job.state != "succeeded") {
    std::cerr << "kiln: The job " << printable(job.id) << " failed";
    if (job.error) {
      std::cerr << " (" << printable(job.error->code) << "): " << printable(job.error->detail);
      if (!job.error->pointer.empty()) std::cerr << " At " << printable(job.error->pointer) << ".";
    }
    std::cerr << '\n';
    return kFailed;
  }
  if (!arguments.max_error) return kSucceeded;
  if (job.quality.error && *job.quality.error <= *arguments.max_error) return kSucceeded;
  std::cerr << "kiln: The error is "
            << (job.quality.error ? format_error(*job.quality.error) : "not known")
            << ", above --max-error " << format_error(*arguments.max_error) << ".\n";
  return kGateMissed;
}

}  // namespace lightkiln::cli
