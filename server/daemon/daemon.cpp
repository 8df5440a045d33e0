#include "server/daemon/daemon.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <future>
#include <sstream>

#include <unistd.h>

#include "core/base/error.h"
#include "server/daemon/housekeeper.h"
#include "server/daemon/supervisor.h"
#include "server/http/api.h"
#include "server/http/fence.h"
#include "server/store/store.h"
#include "server/worker/sandbox_policy.h"

namespace lightkiln {

namespace {

constexpr int64_t kDrainMs = 5000;
constexpr int64_t kWorkerGraceMs = 10000;

std::string read_text(const std::string& path, const char* what) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw Error(ErrorCode::unavailable, std::string("The ") + what + " cannot be read.");
  return text.str();
}

StoreOptions store_options(const ServeConfig& config) {
  StoreOptions options;
  options.directory = config.store_directory;
  options.lease_ms = config.lease_ms;
  return options;
}

ApiOptions api_options(const ServeConfig& config) {
  ApiOptions options;
  options.hosts = config.hosts;
  options.hosts.push_back(config.host);
  if (config.token_file.empty()) return options;
  options.tokens = parse_tokens(read_text(config.token_file, "token file"));
  if (options.tokens.empty())
    throw Error(ErrorCode::invalid_spec, "The token file holds no token.");
  return options;
}

FenceLimits fence_limits(const ServeConfig& config) {
  FenceLimits limits;
  limits.connections = config.max_connections;
  limits.connections_per_address = config.max_connections_per_address;
  return limits;
}

std::vector<std::vector<std::string>> worker_commands(const ServeConfig& config) {
  std::vector<std::vector<std::string>> commands;
  for (int i = 0; i < config.workers; ++i) {
    commands.push_back({config.worker_program, "worker", "--store", config.store_directory,
                        "--oven", config.oven_path, "--threads", std::to_string(config.threads),
                        "--oven-memory-mib", std::to_string(config.oven_memory_bytes >> 20),
                        "--chunk-seconds", std::to_string(config.chunk_seconds), "--task-seconds",
                        std::to_string(config.task_seconds), "--lease-ms",
                        std::to_string(config.lease_ms), "--name", "local-" + std::to_string(i)});
    for (const std::string& layer : config.allow_missing_sandbox)
      commands.back().insert(commands.back().end(), {"--allow-missing-sandbox", layer});
  }
  return commands;
}

// Whoever waits for the file sees it whole or not at all.
void write_port_file(const std::string& path, int port) {
  const std::string temporary = path + ".new";
  std::ofstream out(temporary);
  out << port << '\n';
  out.close();
  std::error_code failed;
  if (out) std::filesystem::rename(temporary, path, failed);
  if (!out || failed) throw Error(ErrorCode::unavailable, "The port file cannot be written.");
}

}  // namespace

struct Daemon::Impl {
  explicit Impl(const ServeConfig& config)
      : log(config.log_level),
        store(open_sqlite_store(store_options(config))),
        api(*store, log, api_options(config)),
        fence(fence_limits(config), api.application()),
        port(fence.listen(config.host, config.port)),
        supervisor(log, worker_commands(config)),
        housekeeper(*store, log, config.keep_unused_days * 24 * 3600) {
    if (!config.port_file.empty()) write_port_file(config.port_file, port);
    log.write(LogLevel::info, "serving",
              {{"host", std::string_view(config.host)},
               {"port", static_cast<int64_t>(port)},
               {"workers", static_cast<int64_t>(config.workers)}});
  }

  Log log;
  const std::unique_ptr<Store> store;
  Api api;
  Fence fence;
  const int port;
  Supervisor supervisor;
  Housekeeper housekeeper;
};

Daemon::Daemon(const ServeConfig& config) {
  check(config);
  impl_ = std::make_unique<Impl>(config);
}

Daemon::~Daemon() {
  stop();
}

int Daemon::port() const {
  return impl_->port;
}

std::vector<int> Daemon::workers() const {
  const auto processes = impl_->supervisor.processes();
  return {processes.begin(), processes.end()};
}

void Daemon::stop() {
  impl_->supervisor.begin_stop();
  impl_->api.stop_waiting();
  impl_->fence.stop(kDrainMs);
  impl_->supervisor.stop(kWorkerGraceMs);
}

int serve(const ServeConfig& config) {
  // Blocked before any thread exists, so that only this one takes them.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  const pid_t parent = ::getppid();
  // Said here and at once: workers would say it again and again, and jobs would only wait.
  if (config.workers > 0) try_sandbox(config.oven_path, config.allow_missing_sandbox);
  Daemon daemon(config);

  const timespec turn{0, 200'000'000};
  while (sigtimedwait(&signals, nullptr, &turn) < 0)
    if (config.parent_watch && ::getppid() != parent) break;

  auto stopped = std::async(std::launch::async, [&daemon] { daemon.stop(); });
  while (stopped.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready) {
    if (sigtimedwait(&signals, nullptr, &turn) < 0) continue;
    for (const int process : daemon.workers()) ::kill(process, SIGKILL);
    ::_exit(1);
  }
  return 0;
}

}  // namespace lightkiln
