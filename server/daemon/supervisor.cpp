#include "server/daemon/supervisor.h"

#include <algorithm>
#include <cerrno>
#include <csignal>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace lightkiln {

namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kTurn = std::chrono::milliseconds(50);
// A worker that lived so long starts again at once; one that did not waits 0.1, 0.2, … 5 s.
constexpr auto kLongEnough = std::chrono::seconds(10);

std::chrono::milliseconds back_off(int failures) {
  return std::chrono::milliseconds(std::min(5000, 100 << std::min(failures - 1, 6)));
}

// The child gets no blocked signals, default dispositions, and a process group of its own, so that
// Ctrl-C in a terminal reaches it only through us.
int spawn(const std::vector<std::string>& command, pid_t* process) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  const int failed =
      ::posix_spawn(process, command[0].c_str(), nullptr, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  return failed;
}

}  // namespace

Supervisor::Supervisor(Log& log, std::vector<std::vector<std::string>> commands) : log_(log) {
  for (auto& command : commands) {
    Child child;
    child.command = std::move(command);
    children_.push_back(std::move(child));
  }
  // Children are told of the death of the thread that made them, so this one lives as long as they.
  thread_ = std::thread([this] { watch(); });
}

Supervisor::~Supervisor() {
  stop(0);
}

void Supervisor::begin_stop() {
  std::lock_guard lock(mutex_);
  stopping_ = true;
  for (const Child& child : children_)
    if (child.process > 0) ::kill(child.process, SIGTERM);
}

void Supervisor::stop(int64_t grace_ms) {
  if (!thread_.joinable()) return;
  begin_stop();
  {
    std::unique_lock lock(mutex_);
    const auto none_left = [this] {
      return std::all_of(children_.begin(), children_.end(),
                         [](const Child& child) { return child.process == 0; });
    };
    changed_.wait_for(lock, std::chrono::milliseconds(grace_ms), none_left);
    for (const Child& child : children_)
      if (child.process > 0) ::kill(child.process, SIGKILL);
  }
  thread_.join();
}

std::vector<pid_t> Supervisor::processes() const {
  std::lock_guard lock(mutex_);
  std::vector<pid_t> running;
  for (const Child& child : children_)
    if (child.process > 0) running.push_back(child.process);
  return running;
}

void Supervisor::start(Child& child) {
  std::vector<std::string> command = child.command;
  command.insert(command.end(), {"--parent", std::to_string(::getpid())});
  child.started = Clock::now();
  const int failed = spawn(command, &child.process);
  if (failed != 0) {
    child.process = 0;
    child.start_at = Clock::now() + back_off(++child.failures);
    log_.write(LogLevel::error, "worker_not_started", {{"errno", static_cast<int64_t>(failed)}});
    return;
  }
  log_.write(LogLevel::info, "worker_started", {{"process", static_cast<int64_t>(child.process)}});
}

void Supervisor::reap(Child& child) {
  int status = 0;
  if (::waitpid(child.process, &status, WNOHANG) != child.process) return;
  const auto now = Clock::now();
  child.failures = now - child.started >= kLongEnough ? 0 : child.failures + 1;
  child.start_at = child.failures == 0 ? now : now + back_off(child.failures);
  log_.write(stopping_ ? LogLevel::info : LogLevel::warning, "worker_ended",
             {{"process", static_cast<int64_t>(child.process)},
              {"signal", static_cast<int64_t>(WIFSIGNALED(status) ? WTERMSIG(status) : 0)},
              {"exit_code", static_cast<int64_t>(WIFEXITED(status) ? WEXITSTATUS(status) : -1)}});
  child.process = 0;
  changed_.notify_all();
}

void Supervisor::watch() {
  std::unique_lock lock(mutex_);
  for (;;) {
    bool any = false;
    for (Child& child : children_) {
      if (child.process > 0) reap(child);
      if (child.process == 0 && !stopping_ && Clock::now() >= child.start_at) start(child);
      any = any || child.process > 0;
    }
    if (stopping_ && !any) return;
    lock.unlock();
    std::this_thread::sleep_for(kTurn);
    lock.lock();
  }
}

}  // namespace lightkiln
