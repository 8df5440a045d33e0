#pragma once

// The command line as plain structs. arguments.cpp is the only user of CLI11.

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lightkiln::cli {

enum class Verb { bake, submit, wait, fetch, ls, show, cancel, plan, view, version };

struct Arguments {
  Verb verb = Verb::version;

  // Everywhere.
  std::string server;      // "" = a private daemon where that makes sense
  std::string token_file;  // "" = no token
  bool json = false;       // data on stdout as JSON
  bool quiet = false;      // no progress
  double timeout_s = 0;    // 0 = none

  std::string target;  // the order file, the job's id or the image
  std::string output;  // -o; "" = not given

  // Orders.
  std::string name;
  std::map<std::string, std::string> labels;
  int priority = 0;
  std::optional<double> max_error;  // exit 6 when the result's error is above
  bool cancel_on_timeout = false;

  // The private daemon.
  std::string store;  // "" = in the user's cache
  int threads = 0;    // 0 = one per processor

  // ls
  std::string state, kind, text, label;
  int limit = 50;
  // fetch: names of artifacts; empty = all
  std::vector<std::string> artifacts;
  // view
  double exposure_stops = 0;
};

struct ParsedArguments {
  std::optional<Arguments> arguments;
  int exit_code = 0;  // when there are none: help was shown or the line was refused
};
// Prints help to stdout and faults to stderr.
ParsedArguments parse_arguments(int argc, const char* const* argv);

}  // namespace lightkiln::cli
