#include <iostream>

#include "proto/json_writer.h"
#include "server/cli/commands/commands.h"
#include "server/cli/commands/text.h"

namespace lightkiln::cli {
namespace {

ExitCode run_verb(const Arguments& arguments) {
  switch (arguments.verb) {
    case Verb::bake:
      return bake(arguments);
    case Verb::submit:
      return submit(arguments);
    case Verb::wait:
      return wait(arguments);
    case Verb::fetch:
      return fetch(arguments);
    case Verb::ls:
      return ls(arguments);
    case Verb::show:
      return show(arguments);
    case Verb::cancel:
      return cancel(arguments);
    case Verb::plan:
      return plan(arguments);
    case Verb::view:
      return view(arguments);
    case Verb::version:
      return version(arguments);
  }
  return kUsage;
}

void print_faults(const Problem& problem) {
  for (const SpecFault& fault : problem.errors) {
    std::cerr << "  " << (fault.pointer.empty() ? "the document" : printable(fault.pointer)) << ": "
              << printable(fault.message);
    if (fault.message.find(fault.suggestion) == std::string::npos)
      std::cerr << " Did you mean \"" << printable(fault.suggestion) << "\"?";
    std::cerr << '\n';
  }
}

}  // namespace

ExitCode version(const Arguments& arguments) {
  const VersionMessage own{.name = "kiln"};
  std::optional<VersionMessage> server;
  if (!arguments.server.empty()) {
    Session session(arguments, ServerNeed::must_be_named);
    server = session.client().version();
  }
  if (arguments.json) {
    JsonWriter writer;
    writer.begin_object().key("client").raw(write_version(own)).key("server");
    if (server)
      writer.raw(write_version(*server));
    else
      writer.null();
    writer.end_object();
    std::cout << writer.take() << '\n';
    return kSucceeded;
  }
  std::cout << "kiln " << own.version << '\n';
  if (server)
    std::cout << "server " << printable(server->version) << ", engine "
              << printable(server->engine_version) << '\n';
  return kSucceeded;
}

int run(int argc, const char* const* argv) {
  const ParsedArguments parsed = parse_arguments(argc, argv);
  if (!parsed.arguments) return parsed.exit_code;
  try {
    const ExitCode code = run_verb(*parsed.arguments);
    std::cout.flush();
    if (std::cout) return code;
    std::cerr << "kiln: The output cannot be written.\n";
    return kFailed;
  } catch (const Exit& exit) {
    return exit.code();
  } catch (const ServerProblem& refusal) {
    std::cerr << "kiln: " << printable(refusal.what()) << '\n';
    print_faults(refusal.problem());
    return refusal.code() == ErrorCode::cancelled ? kCancelled : exit_code(refusal);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::cancelled && Attention::interrupts() == 0) {
      std::cerr << "kiln: --timeout passed. " << printable(error.what()) << '\n';
      return kTimedOut;
    }
    std::cerr << "kiln: " << printable(error.what());
    if (!error.where().empty()) std::cerr << " (at " << printable(error.where()) << ")";
    std::cerr << '\n';
    return exit_code(error);
  } catch (const std::exception& error) {
    std::cerr << "kiln: " << printable(error.what()) << '\n';
    return kFailed;
  }
}

}  // namespace lightkiln::cli
