#pragma once

// A command with its server: a named one, or a private daemon.

#include <memory>
#include <optional>
#include <string>

#include "proto/client.h"
#include "server/cli/commands/arguments.h"
#include "server/cli/commands/attention.h"
#include "server/cli/commands/exit_code.h"
#include "server/cli/commands/private_daemon.h"

namespace lightkiln::cli {

// Ends a command with a code of its own after everything was said.
class Exit : public std::exception {
 public:
  explicit Exit(ExitCode code) : code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

// Says on stderr what is wrong with the command line and ends with kUsage.
[[noreturn]] void usage_error(const std::string& sentence);

enum class ServerNeed { must_be_named, private_will_do };

class Session {
 public:
  Session(const Arguments& arguments, ServerNeed need);

  const Arguments& arguments() const { return arguments_; }
  Attention& attention() { return attention_; }
  Client& client() { return *client_; }
  bool is_private() const { return daemon_ != nullptr; }
  // How to come back to a job, as a command line.
  std::string reattach_hint(const std::string& job_id) const;

 private:
  const Arguments& arguments_;
  Attention attention_;
  std::unique_ptr<PrivateDaemon> daemon_;
  std::optional<Client> client_;
};

}  // namespace lightkiln::cli
