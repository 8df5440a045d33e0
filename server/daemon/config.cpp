#include "server/daemon/config.h"

#include <charconv>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "server/http/gate.h"
#include "server/oven/sandbox.h"
#include "server/worker/sandbox_policy.h"

namespace lightkiln {

namespace {

std::vector<std::string> layer_names() {
  std::vector<std::string> names = {kAllLayers};
  for (const SandboxLayer& layer : sandbox_layers()) names.emplace_back(layer.name);
  return names;
}

// What an operator grants to every job; the same for both commands.
template <typename Config>
void add_grants(CLI::App& app, Config& config) {
  app.add_option("--threads", config.threads, "Threads of each worker's oven; 0 = one a processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option_function<uint64_t>(
         "--oven-memory-mib",
         [&config](const uint64_t& mebibytes) { config.oven_memory_bytes = mebibytes << 20; },
         "Memory that one job may take, in MiB; 0 = no limit")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 24))
      ->default_str(std::to_string(config.oven_memory_bytes >> 20));
  app.add_option("--chunk-seconds", config.chunk_seconds, "Work aimed at per chunk")
      ->check(CLI::Range(0.001, 3600.0))
      ->capture_default_str();
  app.add_option("--task-seconds", config.task_seconds, "Wall time that one task may take")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  app.add_option("--allow-missing-sandbox", config.allow_missing_sandbox,
                 "Bake although this machine lacks these layers of an oven's sandbox, or 'all'")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(layer_names()));
  app.add_option("--lease-ms", config.lease_ms, "Time after which a silent worker loses its task")
      ->check(CLI::Range(500, 3600000))
      ->capture_default_str();
}

void add_serve(CLI::App& app, ServeConfig& config, std::string& listen, std::string& level) {
  app.add_option("--store", config.store_directory, "Folder of the store; made when absent")
      ->required();
  app.add_option("--listen", listen, "Address and port; port 0 takes a free one")
      ->default_str(listen);
  app.add_option("--port-file", config.port_file,
                 "File to write the port to once requests are taken");
  app.add_option("--workers", config.workers, "Worker processes to run; 0 = none")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  add_grants(app, config);
  app.add_option("--oven", config.oven_path,
                 "The oven program; kiln-oven beside this one if unset");
  app.add_option("--token-file", config.token_file,
                 "Lines of: name, SHA-256 of the token in hex, scopes (read,submit,cancel,metrics "
                 "or admin)");
  app.add_option("--allow-host", config.hosts, "Further name that clients may call this host by");
  app.add_flag("--parent-watch", config.parent_watch, "Stop when the parent process ends");
  app.add_option("--log-level", level, "error, warning, info or debug")->default_str(level);
  app.add_option(
         "--keep-unused-days", config.keep_unused_days,
         "Days that uploads are kept which no job refers to and nobody asks for; 0 = for ever")
      ->check(CLI::Range(0.0, 36500.0))
      ->capture_default_str();
  app.add_option("--max-connections", config.max_connections, "Open connections in all")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--max-connections-per-address", config.max_connections_per_address,
                 "Open connections of one address")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
}

void add_worker(CLI::App& app, WorkerConfig& config) {
  WorkerOptions& options = config.options;
  app.add_option("--store", options.store_directory, "Folder of the store")->required();
  add_grants(app, options);
  app.add_option("--oven", options.oven_path,
                 "The oven program; kiln-oven beside this one if unset");
  app.add_option("--name", options.name, "Name in the store and the log");
  app.add_flag("--exit-when-idle", options.exit_when_idle, "End when there is nothing to do");
  app.add_option("--parent", config.parent_process,
                 "End when the process of this number is no longer the parent");
}

}  // namespace

std::string default_oven_path() {
  std::error_code failed;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", failed);
  if (failed) throw Error(ErrorCode::internal, "/proc/self/exe cannot be read.");
  return program.parent_path() / "kiln-oven";
}

void parse_listen(const std::string& text, ServeConfig& config) {
  const Error wrong(ErrorCode::invalid_spec,
                    "--listen must read address:port with a port from 0 to "
                    "65535, for example 127.0.0.1:7420 or [::1]:7420.");
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) throw wrong;
  std::string host = text.substr(0, colon);
  if (host.front() == '[') {
    if (host.back() != ']') throw wrong;
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string::npos) {
    throw wrong;
  }
  int port = -1;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data() + colon + 1, end, port);
  if (result.ec != std::errc() || result.ptr != end || port < 0 || port > 65535 || host.empty())
    throw wrong;
  config.host = host;
  config.port = port;
}

void check(const ServeConfig& config) {
  for (const std::string& host : config.hosts) allowed_host(host);  // throws
  if (!is_loopback(config.host) && config.token_file.empty())
    throw Error(ErrorCode::invalid_spec,
                "Listening on " + config.host +
                    " would let others in; give --token-file, or listen on 127.0.0.1 or [::1].");
}

Command parse_command_line(int argc, const char* const* argv) {
  CLI::App app("Lightkiln's daemon: takes orders over HTTP and bakes them.", "kilnd");
  app.set_version_flag("--version", std::string("kilnd ") + LIGHTKILN_VERSION);
  app.require_subcommand(1);
  ServeConfig serve;
  WorkerConfig worker;
  std::string listen = "127.0.0.1:7420", level = "info";
  CLI::App* serve_app = app.add_subcommand("serve", "Serve the API and run local workers");
  CLI::App* worker_app = app.add_subcommand("worker", "Claim tasks of a store and bake them");
  add_serve(*serve_app, serve, listen, level);
  add_worker(*worker_app, worker);
  try {
    app.parse(argc, argv);
    if (worker_app->parsed()) {
      if (worker.options.oven_path.empty()) worker.options.oven_path = default_oven_path();
      return worker;
    }
    parse_listen(listen, serve);
    serve.log_level = parse_log_level(level);
    if (serve.oven_path.empty()) serve.oven_path = default_oven_path();
    check(serve);
    return serve;
  } catch (const CLI::ParseError& end) {
    std::ostringstream out, err;
    const int code = app.exit(end, out, err);
    return CommandLineEnd{code == 0 ? 0 : 2, out.str() + err.str()};
  } catch (const Error& error) {
    return CommandLineEnd{2, std::string(error.what()) + '\n'};
  }
}

}  // namespace lightkiln
