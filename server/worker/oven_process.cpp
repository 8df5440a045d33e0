#include "server/worker/oven_process.h"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/parallel.h"

#ifdef LIGHTKILN_SANITIZED
extern char** environ;
#endif

namespace lightkiln {

namespace {

constexpr int kOvenSocket = 3;

// How often the kernel has killed a process for want of memory since it started.
uint64_t oom_kills() {
  std::ifstream in("/proc/vmstat");
  std::string name;
  for (uint64_t value = 0; in >> name >> value;)
    if (name == "oom_kill") return value;
  return 0;
}

class SpawnActions {
 public:
  SpawnActions() { posix_spawn_file_actions_init(&actions_); }
  ~SpawnActions() { posix_spawn_file_actions_destroy(&actions_); }
  SpawnActions(const SpawnActions&) = delete;
  SpawnActions& operator=(const SpawnActions&) = delete;
  posix_spawn_file_actions_t* get() { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

class SpawnAttributes {
 public:
  // Handlers and masks of the worker are not the oven's; a group of its own keeps a terminal's
  // Ctrl-C from reaching it before its worker decides.
  SpawnAttributes() {
    posix_spawnattr_init(&attributes_);
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setsigdefault(&attributes_, &all);
    posix_spawnattr_setpgroup(&attributes_, 0);
    posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnAttributes() { posix_spawnattr_destroy(&attributes_); }
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;
  posix_spawnattr_t* get() { return &attributes_; }

 private:
  posix_spawnattr_t attributes_;
};

}  // namespace

OvenProcess::OvenProcess(const OvenOptions& options, std::function<bool()> interrupted)
    : oom_kills_before_(oom_kills()) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw Error(ErrorCode::unavailable, "No socket is left for an oven.");
  Descriptor ours(ends[0]), theirs(ends[1]);
  // dup2 onto itself would keep the close-on-exec flag: hold a number that is never 3.
  if (theirs.get() == kOvenSocket)
    theirs.reset(fcntl(theirs.get(), F_DUPFD_CLOEXEC, kOvenSocket + 1));
  SpawnActions actions;
  posix_spawn_file_actions_addopen(actions.get(), 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(actions.get(), 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(actions.get(), theirs.get(), kOvenSocket);
  SpawnAttributes attributes;

  std::string memory = std::to_string(
      options.memory_bytes > 0 ? options.memory_bytes + options.address_space_besides : 0);
  std::string program = options.path;
  char* arguments[] = {program.data(), memory.data(), nullptr};
  // What the worker's environment holds is no business of a program that opens clients' files.
  char* nothing[] = {nullptr};
  char** environment = nothing;
#ifdef LIGHTKILN_SANITIZED
  environment = environ;  // where sanitizers look for their options
#endif
  const int failure =
      posix_spawn(&pid_, program.c_str(), actions.get(), attributes.get(), arguments, environment);
  if (failure != 0) {
    pid_ = -1;
    throw Error(ErrorCode::unavailable, "The oven '" + options.path +
                                            "' cannot be started: " + std::strerror(failure) + ".");
  }
  channel_ = std::make_unique<Channel>(std::move(ours), std::move(interrupted));
}

OvenProcess::~OvenProcess() {
  if (pid_ > 0) stop(0);
}

bool OvenProcess::ended() const {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         info.si_pid == pid_;
}

void OvenProcess::stop(int grace_ms) {
  if (pid_ <= 0) return;
  channel_.reset();  // a closed pipe is the request to stop
  const double deadline_s = wall_seconds() + 1e-3 * grace_ms;
  int status = 0;
  while (grace_ms > 0 && wall_seconds() < deadline_s) {
    if (waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      return;
    }
    usleep(2000);
  }
  kill(pid_, SIGKILL);
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
}

OvenDeath OvenProcess::bury() {
  int status = 0;
  // Its end of the pipe is closed, so it is dead or about to be.
  const double deadline_s = wall_seconds() + 1.0;
  pid_t reaped = 0;
  while ((reaped = waitpid(pid_, &status, WNOHANG)) == 0 && wall_seconds() < deadline_s)
    usleep(1000);
  if (reaped == 0) {
    stop(0);
    return {"oven_crashed", "The oven closed its pipe and did not end."};
  }
  pid_ = -1;
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL && oom_kills() > oom_kills_before_)
    return {"out_of_memory", "The oven was killed because the machine ran out of memory."};
  if (WIFSIGNALED(status)) {
    const char* name = sigabbrev_np(WTERMSIG(status));
    return {"oven_crashed", std::string("The oven died of signal ") +
                                std::to_string(WTERMSIG(status)) + " (SIG" + (name ? name : "?") +
                                ") while it worked on this job."};
  }
  return {"oven_crashed", "The oven ended with exit code " + std::to_string(WEXITSTATUS(status)) +
                              " without an answer."};
}

}  // namespace lightkiln
