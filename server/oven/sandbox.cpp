#include "server/oven/sandbox.h"

#include <cerrno>
#include <csignal>
#include <cstddef>

#include <fcntl.h>
#include <linux/landlock.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace lightkiln {

namespace {

bool prefer_for_oom_kill(const SandboxOptions&) {
  const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool written = write(fd, "1000", 4) == 4;
  close(fd);
  return written;
}

bool limit(__rlimit_resource_t resource, rlim_t value) {
  rlimit limits{value, value};
  rlimit present{};
  getrlimit(resource, &present);
  if (present.rlim_max < value) limits = {present.rlim_max, present.rlim_max};
  return setrlimit(resource, &limits) == 0;
}

bool limit_resources(const SandboxOptions&) {
  bool all = limit(RLIMIT_CORE, 0);
  all &= limit(RLIMIT_FSIZE, 0);
  all &= limit(RLIMIT_NOFILE, 64);
  return all;
}

bool limit_address_space(const SandboxOptions& options) {
  return options.memory_bytes == 0 || limit(RLIMIT_AS, options.memory_bytes);
}

// One call for all three is refused as a whole where one is: user first, which grants the others.
bool leave_namespaces(const SandboxOptions&) {
  const bool user = unshare(CLONE_NEWUSER) == 0;
  const bool net = unshare(CLONE_NEWNET) == 0;
  const bool ipc = unshare(CLONE_NEWIPC) == 0;
  return user && net && ipc;
}

// A change of credentials clears this setting, so it comes after the namespaces. A parent that died
// before is noticed because its end of the pipe is closed.
bool die_with_parent(const SandboxOptions&) {
  return prctl(PR_SET_PDEATHSIG, SIGKILL) == 0;
}

bool renounce_privileges(const SandboxOptions&) {
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0;
}

// The attribute as newer kernels know it; older ones accept it when the unknown tail is zero.
struct LandlockAttributes {
  uint64_t handled_access_fs;
  uint64_t handled_access_net;
  uint64_t scoped;
};

// Rights grow with the ABI (Linux, Documentation/userspace-api/landlock.rst): 13 at first, REFER at
// 2, TRUNCATE at 3, TCP bind and connect at 4, IOCTL_DEV at 5, scopes for abstract sockets and
// signals at 6.
bool leave_file_system(const SandboxOptions&) {
  const long abi =
      syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (abi < 1) return false;
  LandlockAttributes attributes{};
  const int file_rights = abi >= 5 ? 16 : abi >= 3 ? 15 : abi >= 2 ? 14 : 13;
  attributes.handled_access_fs = (1ull << file_rights) - 1;
  size_t size = sizeof attributes.handled_access_fs;
  if (abi >= 4) {
    attributes.handled_access_net = 3;
    size = offsetof(LandlockAttributes, scoped);
  }
  if (abi >= 6) {
    attributes.scoped = 3;
    size = sizeof attributes;
  }
  const long ruleset = syscall(SYS_landlock_create_ruleset, &attributes, size, 0);
  if (ruleset < 0) return false;
  const bool restricted = syscall(SYS_landlock_restrict_self, ruleset, 0) == 0;
  close(static_cast<int>(ruleset));
  return restricted;
}

// Memory, threads, clocks, and the pipe that is open already. No call here can open, connect,
// execute, trace or name anything.
constexpr int kAllowedCalls[] = {
    SCMP_SYS(read),
    SCMP_SYS(write),
    SCMP_SYS(readv),
    SCMP_SYS(writev),
    SCMP_SYS(recvmsg),
    SCMP_SYS(sendmsg),
    SCMP_SYS(poll),
    SCMP_SYS(ppoll),
    SCMP_SYS(close),
    SCMP_SYS(lseek),
    SCMP_SYS(munmap),
    SCMP_SYS(mremap),
    SCMP_SYS(brk),
    SCMP_SYS(madvise),
    SCMP_SYS(futex),
    SCMP_SYS(set_robust_list),
    SCMP_SYS(rseq),
    SCMP_SYS(sched_getaffinity),
    SCMP_SYS(sched_yield),
    SCMP_SYS(nanosleep),
    SCMP_SYS(clock_nanosleep),
    SCMP_SYS(clock_gettime),
    SCMP_SYS(clock_getres),
    SCMP_SYS(gettimeofday),
    SCMP_SYS(getpid),
    SCMP_SYS(gettid),
    SCMP_SYS(getppid),
    SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigreturn),
    SCMP_SYS(sigaltstack),
    SCMP_SYS(restart_syscall),
    SCMP_SYS(getrandom),
    SCMP_SYS(getrusage),
    SCMP_SYS(uname),
    SCMP_SYS(sysinfo),
    SCMP_SYS(getcpu),
    SCMP_SYS(membarrier),
    SCMP_SYS(exit),
    SCMP_SYS(exit_group),
};

bool add_rules(scmp_filter_ctx filter) {
  bool all = true;
  for (const int call : kAllowedCalls)
    all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0) == 0;
  // No page may become executable.
  for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)})
    all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1,
                            SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0;
  // Threads, but no processes. clone3 hides its flags from filters; told that it does not exist,
  // the C library uses clone.
  all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                          SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)) == 0;
  all &= seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0;
  // abort() sends its own process a signal; reading a limit is not setting one.
  all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1,
                          SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(getpid()))) == 0;
  all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(prlimit64), 1,
                          SCMP_A2(SCMP_CMP_EQ, 0)) == 0;
  all &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(prctl), 1,
                          SCMP_A0(SCMP_CMP_EQ, PR_SET_NAME)) == 0;
  return all;
}

bool limit_system_calls(const SandboxOptions&) {
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
  if (!filter) return false;
  const bool loaded = add_rules(filter) && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return loaded;
}

constexpr SandboxLayer kLayers[] = {
    {"oom_score", "is the first to end when the machine runs out of memory", prefer_for_oom_kill,
     true},
    {"limits", "makes no file or core dump, and holds few descriptors", limit_resources, true},
    {"address_space", "takes no more memory than it is granted", limit_address_space, false},
    {"namespaces", "has no network and shares no memory", leave_namespaces, true},
    {"parent_death", "ends with its worker", die_with_parent, true},
    {"no_new_privileges", "gains no rights by executing a program", renounce_privileges, true},
    {"landlock", "opens no file", leave_file_system, false},
    {"seccomp", "asks the kernel for memory, threads and clocks, and for nothing else",
     limit_system_calls, false},
};

}  // namespace

std::span<const SandboxLayer> sandbox_layers() {
  return kLayers;
}

const SandboxLayer* find_sandbox_layer(std::string_view name) {
  for (const SandboxLayer& layer : kLayers)
    if (name == layer.name) return &layer;
  return nullptr;
}

std::vector<std::string> enter_sandbox(const SandboxOptions& options) {
#ifdef LIGHTKILN_SANITIZED
  constexpr bool kSanitized = true;
#else
  constexpr bool kSanitized = false;
#endif
  std::vector<std::string> missing;
  for (const SandboxLayer& layer : kLayers)
    if ((kSanitized && !layer.with_sanitizers) || !layer.enter(options))
      missing.emplace_back(layer.name);
  return missing;
}

}  // namespace lightkiln
