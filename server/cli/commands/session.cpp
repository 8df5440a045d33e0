#include "server/cli/commands/session.h"

#include <fstream>
#include <iostream>
#include <iterator>

namespace lightkiln::cli {
namespace {

std::string read_token(const std::string& path) {
  if (path.empty()) return "";
  std::ifstream file(path);
  if (!file) usage_error("The token file " + path + " cannot be read.");
  std::string token{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const size_t first = token.find_first_not_of(" \t\r\n");
  const size_t last = token.find_last_not_of(" \t\r\n");
  token = first == std::string::npos ? "" : token.substr(first, last - first + 1);
  for (const char c : token)
    if (c <= 0x20 || c >= 0x7F) usage_error("The token file " + path + " holds no token.");
  if (token.empty() || token.size() > 4096)
    usage_error("The token file " + path + " holds no token.");
  return token;
}

}  // namespace

void usage_error(const std::string& sentence) {
  std::cerr << "kiln: " << sentence << '\n';
  throw Exit(kUsage);
}

Session::Session(const Arguments& arguments, ServerNeed need)
    : arguments_(arguments), attention_(arguments.timeout_s) {
  ClientOptions options;
  options.interrupted = [this] { return attention_.wanted(); };
  if (!arguments.server.empty()) {
    if (!arguments.store.empty()) usage_error("--store is for baking without --server.");
    options.server = arguments.server;
    options.token = read_token(arguments.token_file);
  } else if (need == ServerNeed::must_be_named) {
    usage_error("Name the server with --server or LIGHTKILN_SERVER.");
  } else {
    const std::filesystem::path store =
        arguments.store.empty() ? default_store() : std::filesystem::path(arguments.store);
    daemon_ =
        std::make_unique<PrivateDaemon>(PrivateDaemonOptions{store, arguments.threads}, attention_);
    options.server = daemon_->url();
  }
  try {
    client_.emplace(options);
  } catch (const Error& error) {
    usage_error(error.what());
  }
}

std::string Session::reattach_hint(const std::string& job_id) const {
  if (daemon_)
    return "What is finished stays in " + daemon_->store().string() +
           "; the same command goes on from there.";
  return "It goes on. Come back with: kiln wait " + job_id + " --server " + client_->server();
}

}  // namespace lightkiln::cli
