// Each promise is tried from inside a forked child, whose exit code says what happened.

#include "server/oven/sandbox.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <new>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/trace/tracer.h"

namespace lightkiln {
namespace {

// The exit code of `body` in a child, inside the sandbox or not; -signal when it died of one.
int in_child(bool sandboxed, const std::function<int()>& body, uint64_t memory_bytes = 0) {
  const pid_t child = fork();
  if (child == 0) {
    if (sandboxed) {
      const std::vector<std::string> missing = enter_sandbox({memory_bytes});
      for (const std::string& layer : missing)
        if (layer == "seccomp" || layer == "limits" || layer == "no_new_privileges") _exit(90);
    }
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

class Sandbox : public testing::Test {
 protected:
  void SetUp() override {
#ifdef LIGHTKILN_SANITIZED
    GTEST_SKIP() << "sanitizers and a sandbox exclude each other";
#endif
  }
  // 0 when refused; each has its positive control: outside the sandbox it works.
  void expect_refused(const std::function<int()>& attempt) {
    EXPECT_EQ(in_child(false, attempt), 1) << "the control must succeed";
    EXPECT_EQ(in_child(true, attempt), 0);
  }
};

TEST_F(Sandbox, OpensNoFileToRead) {
  expect_refused([] { return open("/etc/hostname", O_RDONLY) >= 0 ? 1 : 0; });
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
  const auto attempt = [] {
    char program[] = "/bin/false";  // exits with 1
    char* arguments[] = {program, nullptr};
    execve(program, arguments, nullptr);
    return 0;
  };
  expect_refused(attempt);
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
  EXPECT_EQ(in_child(true,
                     [] {
                       const rlimit wide{1 << 20, 1 << 20};
                       return setrlimit(RLIMIT_NOFILE, &wide) == 0 ? 1 : 0;
                     }),
            0);
}
TEST_F(Sandbox, NamesTheLayersThatThisKernelDoesNotHave) {
  const int missing = in_child(false, [] {
    int landlock = 0;
    for (const std::string& layer : enter_sandbox({})) landlock |= layer == "landlock" ? 1 : 0;
    return landlock;
  });
  const bool kernel_has_it = syscall(SYS_landlock_create_ruleset, nullptr, 0, 1) >= 1;
  EXPECT_EQ(missing, kernel_has_it ? 0 : 1);
}
TEST_F(Sandbox, AMemoryBombEndsInBadAlloc) {
  EXPECT_EQ(in_child(
                true,
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
  EXPECT_EQ(in_child(true,
                     [] {
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
  EXPECT_EQ(in_child(true, []() -> int { abort(); }), -SIGABRT);
}
TEST_F(Sandbox, OpenExrWorksInside) {
  EXPECT_EQ(in_child(true,
                     [] {
                       Image image(64, 32, 3);
                       image.pixels[5] = 2.5f;
                       const DecodedImage back = read_exr(write_exr(image, {}));
                       return back.image.pixels == image.pixels ? 1 : 0;
                     }),
            1);
}
TEST_F(Sandbox, EmbreeWorksInsideWithItsThreads) {
  EXPECT_EQ(
      in_child(
          true,
          [] {
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
