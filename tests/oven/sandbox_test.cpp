// Each promise is tried from inside a forked child, whose exit code says what happened.

#include "server/oven/sandbox.h"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <functional>
#include <new>
#include <set>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/trace/tracer.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

#ifdef LIGHTKILN_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

constexpr int kNotEntered = 90;

// What became of a child that ends with what `body` returns: its exit code, or -signal.
int in_child(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) _exit(body());
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

// As above, inside the whole sandbox.
int in_sandbox(const std::function<int()>& body, uint64_t memory_bytes = 0) {
  return in_child([&] {
    for (const std::string& name : enter_sandbox({memory_bytes}))
      if (name == "limits" || name == "no_new_privileges" || (name == "seccomp" && !kSanitized))
        return kNotEntered;
    return body();
  });
}

// --- each layer alone --------------------------------------------------------------------------

class SandboxLayerTest : public testing::Test {
 protected:
  // What `body` returns with that layer entered and no other but the one that lets it be entered.
  int with(const char* name, const std::function<int()>& body, uint64_t memory_bytes = 0) {
    return in_child([&] {
      const SandboxOptions options{memory_bytes};
      find_sandbox_layer("no_new_privileges")->enter(options);
      return find_sandbox_layer(name)->enter(options) ? body() : kNotEntered;
    });
  }
  // `attempt` gives 1 when it succeeds and 0 when it is refused.
  void expect_refused_by(const char* name, const std::function<int()>& attempt,
                         uint64_t memory_bytes = 0) {
    if (kSanitized && !find_sandbox_layer(name)->with_sanitizers)
      GTEST_SKIP() << "no sanitizer lives in the layer " << name;
    EXPECT_EQ(in_child(attempt), 1) << "the control must succeed";
    const int end = with(name, attempt, memory_bytes);
    if (end == kNotEntered) GTEST_SKIP() << "the layer " << name << " cannot be had here";
    EXPECT_EQ(end, 0);
  }
};

int open_a_file() {
  return open("/etc/passwd", O_RDONLY) >= 0 ? 1 : 0;
}
int execute() {
  char program[] = "/bin/false";  // exits with 1
  char* arguments[] = {program, nullptr};
  execve(program, arguments, nullptr);
  return 0;
}

// A listening TCP socket on loopback.
class Listener {
 public:
  Listener() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address_), size) != 0 ||
        listen(socket_, 4) != 0 ||
        getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &size) != 0)
      ADD_FAILURE() << "nothing can listen on loopback";
  }
  ~Listener() { close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int connect_to() const {
    const int to = socket(AF_INET, SOCK_STREAM, 0);
    return connect(to, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) == 0 ? 1 : 0;
  }

 private:
  int socket_;
  sockaddr_in address_{};
};

TEST_F(SandboxLayerTest, NamespacesDenyTheNetwork) {
  const Listener listener;
  expect_refused_by("namespaces", [&] { return listener.connect_to(); });
}
TEST_F(SandboxLayerTest, SeccompDeniesTheNetwork) {
  const Listener listener;
  expect_refused_by("seccomp", [&] { return listener.connect_to(); });
}
TEST_F(SandboxLayerTest, LandlockDeniesFiles) {
  expect_refused_by("landlock", open_a_file);
}
TEST_F(SandboxLayerTest, LandlockDeniesPrograms) {
  expect_refused_by("landlock", execute);
}
TEST_F(SandboxLayerTest, SeccompDeniesFiles) {
  expect_refused_by("seccomp", open_a_file);
}
TEST_F(SandboxLayerTest, SeccompDeniesPrograms) {
  expect_refused_by("seccomp", execute);
}
TEST_F(SandboxLayerTest, AddressSpaceDeniesMemory) {
  const auto take_a_gibibyte = [] {
    return mmap(nullptr, 1u << 30, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
                   MAP_FAILED
               ? 1
               : 0;
  };
  expect_refused_by("address_space", take_a_gibibyte, 512u << 20);
}
TEST_F(SandboxLayerTest, LimitsDenyGrowingFiles) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path() / "file";
  expect_refused_by("limits", [&] {
    signal(SIGXFSZ, SIG_IGN);
    const int file = open(path.c_str(), O_WRONLY | O_CREAT, 0600);
    return write(file, "x", 1) == 1 ? 1 : 0;
  });
}
TEST_F(SandboxLayerTest, LimitsDenyManyDescriptors) {
  expect_refused_by("limits", [] {
    int last = 0;
    for (int i = 0; i < 100 && last >= 0; ++i) last = dup(0);
    return last >= 0 ? 1 : 0;
  });
}
TEST_F(SandboxLayerTest, TheFirstToEndWhenMemoryRunsOut) {
  const int score = with("oom_score", [] {
    int value = 0;
    std::ifstream("/proc/self/oom_score_adj") >> value;
    return value == 1000 ? 1 : 0;
  });
  if (score == kNotEntered) GTEST_SKIP() << "/proc is read-only here";
  EXPECT_EQ(score, 1);
}
TEST_F(SandboxLayerTest, PrivilegesAreGoneForGood) {
  EXPECT_EQ(in_child([] { return prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0); }), 0);
  EXPECT_EQ(with("no_new_privileges", [] { return prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0); }), 1);
}
TEST_F(SandboxLayerTest, EndsWithItsParent) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  // The grandchild holds the pipe open for as long as it lives, which is for ever unless it is
  // told.
  const int end = in_child([&] {
    int ready[2];
    if (pipe2(ready, O_CLOEXEC) != 0) return 1;
    if (fork() == 0) {
      find_sandbox_layer("parent_death")->enter({});
      (void)!write(ready[1], "x", 1);
      for (;;) pause();
    }
    char byte = 0;
    return read(ready[0], &byte, 1) == 1 ? 0 : 1;
  });
  EXPECT_EQ(end, 0);
  close(ends[1]);
  pollfd closed{ends[0], POLLIN, 0};
  EXPECT_EQ(poll(&closed, 1, 10'000), 1) << "the grandchild lives on";
  close(ends[0]);
}
TEST_F(SandboxLayerTest, EveryLayerThatIsMissingIsNamed) {
  const int wrong = in_child([] {
    std::set<std::string> named;
    for (const std::string& name : enter_sandbox({})) named.insert(name);
    int count = 0;
    for (const SandboxLayer& layer : sandbox_layers())
      if (kSanitized && !layer.with_sanitizers && !named.contains(layer.name)) ++count;
    const bool kernel_has_landlock = syscall(SYS_landlock_create_ruleset, nullptr, 0, 1) >= 0 ||
                                     errno == EPERM;  // by the filter, entered after it
    if (!kSanitized && !kernel_has_landlock && !named.contains("landlock")) ++count;
    return count;
  });
  EXPECT_EQ(wrong, 0);
}

// --- the whole of it ---------------------------------------------------------------------------

class Sandbox : public testing::Test {
 protected:
  // 0 when refused; each has its positive control: outside the sandbox it works.
  void expect_refused(const std::function<int()>& attempt) {
    if (kSanitized) GTEST_SKIP() << "the layers that refuse this are left out with a sanitizer";
    EXPECT_EQ(in_child(attempt), 1) << "the control must succeed";
    EXPECT_EQ(in_sandbox(attempt), 0);
  }
};

TEST_F(Sandbox, OpensNoFileToRead) {
  expect_refused(open_a_file);
}
TEST_F(Sandbox, OpensNoFileToWrite) {
  expect_refused([] { return open("/tmp", O_WRONLY | O_TMPFILE, 0600) >= 0 ? 1 : 0; });
}
TEST_F(Sandbox, MakesNoSocket) {
  expect_refused([] { return socket(AF_INET, SOCK_STREAM, 0) >= 0 ? 1 : 0; });
}
TEST_F(Sandbox, ConnectsNowhere) {
  const int before = socket(AF_INET, SOCK_DGRAM, 0);
  expect_refused([before] {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(9);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return connect(before, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0 ? 1 : 0;
  });
  close(before);
}
TEST_F(Sandbox, ExecutesNothing) {
  expect_refused(execute);
}
TEST_F(Sandbox, ForksNothing) {
  expect_refused([] {
    const pid_t child = fork();
    if (child == 0) _exit(0);
    return child > 0 ? 1 : 0;
  });
}
TEST_F(Sandbox, TracesNothing) {
  expect_refused([] { return ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0 ? 1 : 0; });
}
TEST_F(Sandbox, MakesNoMemoryExecutable) {
  expect_refused([] {
    return mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
                   MAP_FAILED
               ? 1
               : 0;
  });
}
TEST_F(Sandbox, LiftsNoLimit) {
  EXPECT_EQ(in_sandbox([] {
              const rlimit wide{1 << 20, 1 << 20};
              return setrlimit(RLIMIT_NOFILE, &wide) == 0 ? 1 : 0;
            }),
            0);
}
TEST_F(Sandbox, AMemoryBombEndsInBadAlloc) {
  if (kSanitized) GTEST_SKIP() << "the address space cannot be limited with a sanitizer";
  EXPECT_EQ(in_sandbox(
                [] {
                  try {
                    std::vector<std::vector<char>> bomb;
                    for (;;) bomb.emplace_back(64 << 20, 'x');
                  } catch (const std::bad_alloc&) {
                    return 7;
                  }
                  return 0;
                },
                512ull << 20),
            7);
}
TEST_F(Sandbox, ThreadsAndExceptionsWork) {
  EXPECT_EQ(in_sandbox([] {
              int sum = 0;
              std::vector<std::thread> threads;
              std::vector<int> parts(8);
              for (int i = 0; i < 8; ++i)
                threads.emplace_back([&parts, i] {
                  try {
                    throw i;
                  } catch (int thrown) {
                    parts[static_cast<size_t>(i)] = thrown;
                  }
                });
              for (std::thread& thread : threads) thread.join();
              for (const int part : parts) sum += part;
              return sum;
            }),
            28);
}
TEST_F(Sandbox, AnAbortIsStillAnAbort) {
  EXPECT_EQ(in_sandbox([]() -> int { abort(); }), -SIGABRT);
}
TEST_F(Sandbox, OpenExrWorksInsideWithItsThreads) {
  EXPECT_EQ(in_sandbox([] {
              Image image(64, 320, 3);
              image.pixels[5] = 2.5f;
              ExrWriteOptions options;
              options.threads = 4;
              const DecodedImage back = read_exr(write_exr(image, options));
              return back.image.pixels == image.pixels ? 1 : 0;
            }),
            1);
}
TEST_F(Sandbox, EmbreeWorksInsideWithItsThreads) {
  EXPECT_EQ(in_sandbox([] {
              Scene scene;
              SurfaceMesh mesh;
              for (int i = 0; i < 3000; ++i) {
                const float x = static_cast<float>(i);
                const auto first = static_cast<uint32_t>(mesh.positions.size());
                mesh.positions.insert(mesh.positions.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
                mesh.triangles.push_back({first, first + 1, first + 2});
              }
              scene.meshes.push_back(mesh);
              TracerOptions options;
              options.build_threads = 4;
              const Tracer tracer(scene, options);
              RayCounters counters;
              Ray ray;
              ray.origin = {10.2f, 0.2f, 1};
              ray.direction = {0, 0, -1};
              return tracer.nearest(ray, counters).hit() ? 1 : 0;
            }),
            1);
}

}  // namespace
}  // namespace lightkiln
