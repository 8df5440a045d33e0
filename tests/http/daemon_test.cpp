// The serving process: its settings, its workers, and how it ends.

#include "server/daemon/daemon.h"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/error.h"
#include "proto/json.h"
#include "server/daemon/supervisor.h"
#include "server/oven/frames.h"
#include "server/store/store.h"
#include "tests/http/raw_client.h"
#include "tests/support/data.h"

namespace lightkiln::test {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Whether it becomes true within 10 s.
template <typename Condition>
bool soon(Condition condition) {
  const auto end = steady_clock::now() + std::chrono::seconds(10);
  while (!condition()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return true;
}

// A process that runs; a zombie does not.
bool alive(pid_t process) {
  std::ifstream in("/proc/" + std::to_string(process) + "/stat");
  std::string text;
  std::getline(in, text);
  const size_t name_end = text.rfind(')');
  return name_end != std::string::npos && text[name_end + 2] != 'Z';
}

ServeConfig quiet(const TemporaryFolder& folder) {
  ServeConfig config;
  config.store_directory = folder.path() / "store";
  config.port = 0;
  config.workers = 0;
  config.log_level = LogLevel::error;
  return config;
}

template <typename... Words>
Command parse(Words... words) {
  const char* const argv[] = {"kilnd", words...};
  return parse_command_line(static_cast<int>(sizeof...(words)) + 1, argv);
}
int usage_error(const Command& command) {
  const auto* end = std::get_if<CommandLineEnd>(&command);
  return end ? end->exit_code : -1;
}

TEST(CommandLine, ReadsWhatAnOperatorSets) {
  const Command command = parse("serve", "--store", "/s", "--listen", "[::1]:0", "--workers", "2",
                                "--threads", "3", "--log-level", "debug", "--parent-watch",
                                "--lease-ms", "2000", "--allow-host", "bake.studio");
  const auto& config = std::get<ServeConfig>(command);
  EXPECT_EQ(config.store_directory, "/s");
  EXPECT_EQ(config.host, "::1");
  EXPECT_EQ(config.port, 0);
  EXPECT_EQ(config.workers, 2);
  EXPECT_EQ(config.threads, 3);
  EXPECT_EQ(config.log_level, LogLevel::debug);
  EXPECT_TRUE(config.parent_watch);
  EXPECT_EQ(config.lease_ms, 2000);
  EXPECT_EQ(config.hosts, std::vector<std::string>{"bake.studio"});
  EXPECT_TRUE(config.oven_path.ends_with("/kiln-oven"));
  const Command work =
      parse("worker", "--store", "/s", "--oven", "/o", "--name", "n", "--exit-when-idle");
  const auto& worker = std::get<WorkerConfig>(work);
  EXPECT_EQ(worker.options.oven_path, "/o");
  EXPECT_TRUE(worker.options.exit_when_idle);
}

TEST(CommandLine, SaysWhatIsWrong) {
  EXPECT_EQ(usage_error(parse()), 2);
  EXPECT_EQ(usage_error(parse("serve")), 2) << "no store";
  EXPECT_EQ(usage_error(parse("tea")), 2);
  EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--tea")), 2);
  EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--workers", "-1")), 2);
  EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--log-level", "tea")), 2);
  for (const char* listen : {"7420", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:65536",
                             ":7420", "::1:7420", "[::1:7420", "127.0.0.1:-1"})
    EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--listen", listen)), 2) << listen;
  EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--allow-host", "farm.local:7420")), 2);
  EXPECT_EQ(usage_error(parse("--version")), 0);
  EXPECT_EQ(usage_error(parse("serve", "--help")), 0);
}

TEST(CommandLine, OtherAddressesNeedTokens) {
  for (const char* listen : {"0.0.0.0:7420", "[::]:7420", "192.168.1.5:7420", "example.org:7420"}) {
    EXPECT_EQ(usage_error(parse("serve", "--store", "/s", "--listen", listen)), 2) << listen;
    EXPECT_EQ(
        usage_error(parse("serve", "--store", "/s", "--listen", listen, "--token-file", "/t")), -1)
        << listen;
  }
  const TemporaryFolder folder;
  ServeConfig config = quiet(folder);
  config.host = "0.0.0.0";
  EXPECT_THROW(Daemon{config}, Error);
  config.token_file = folder.path() / "tokens";
  EXPECT_THROW(Daemon{config}, Error) << "the file is missing";
  std::ofstream(config.token_file) << "# none\n";
  EXPECT_THROW(Daemon{config}, Error) << "the file is empty";
}

TEST(DaemonTest, ServesOnAFreePortAndSaysWhich) {
  const TemporaryFolder folder;
  ServeConfig config = quiet(folder);
  config.port_file = folder.path() / "port";
  Daemon daemon(config);
  int port = 0;
  std::ifstream(config.port_file) >> port;
  EXPECT_EQ(port, daemon.port());
  EXPECT_EQ(get(port, "/readyz").status, 200);
  ServeConfig second = config;
  second.port = port;
  EXPECT_THROW(Daemon{second}, Error) << "the port is taken";
  daemon.stop();
  EXPECT_ANY_THROW(RawClient{port});
}

TEST(DaemonTest, TakesTokensFromAFile) {
  const TemporaryFolder folder;
  ServeConfig config = quiet(folder);
  config.token_file = folder.path() / "tokens";
  std::ofstream(config.token_file) << "me " << sha256_digest("secret", 6).substr(7) << " read\n";
  Daemon daemon(config);
  EXPECT_EQ(get(daemon.port(), "/v1/jobs").status, 401);
  EXPECT_EQ(get(daemon.port(), "/v1/jobs", "Authorization: Bearer secret\r\n").status, 200);
}

// --- workers
// --------------------------------------------------------------------------------------

// A program in a folder of its own that appends its process number to `starts` and then runs
// `rest`.
std::string script(const TemporaryFolder& folder, const std::string& rest) {
  const std::string path = folder.path() / "program";
  std::ofstream(path) << "#!/bin/sh\necho $$ >> " << (folder.path() / "starts").string() << '\n'
                      << rest << '\n';
  fs::permissions(path, fs::perms::owner_all);
  return path;
}
std::vector<pid_t> starts(const TemporaryFolder& folder) {
  std::ifstream in(folder.path() / "starts");
  std::vector<pid_t> all;
  for (pid_t one; in >> one;) all.push_back(one);
  return all;
}

TEST(Supervision, AWorkerThatDiesIsStartedAgain) {
  const TemporaryFolder folder;
  Log log(LogLevel::error);
  Supervisor supervisor(log, {{script(folder, "exec sleep 60"), "worker"}});
  ASSERT_TRUE(soon([&] { return starts(folder).size() == 1; }));
  const pid_t first = starts(folder)[0];
  kill(first, SIGKILL);
  ASSERT_TRUE(soon([&] { return starts(folder).size() == 2; }));
  ASSERT_TRUE(soon([&] { return supervisor.processes().size() == 1; }));
  EXPECT_NE(supervisor.processes()[0], first);
  supervisor.stop(5000);
  EXPECT_FALSE(alive(starts(folder)[1]));
}

TEST(Supervision, AWorkerThatCannotLiveIsStartedEverMoreSlowly) {
  const TemporaryFolder folder;
  Log log(LogLevel::error);
  Supervisor supervisor(log, {{script(folder, "exit 1"), "worker"}, {"/no/such/program"}});
  std::this_thread::sleep_for(milliseconds(1500));
  supervisor.stop(5000);
  // At 0, 0.1, 0.3, 0.7 and 1.5 s, give or take a machine under load.
  EXPECT_GE(starts(folder).size(), 2u);
  EXPECT_LE(starts(folder).size(), 5u);
}

TEST(Supervision, AWorkerThatDoesNotStopIsKilled) {
  const TemporaryFolder folder;
  Log log(LogLevel::error);
  Supervisor supervisor(
      log, {{script(folder, "trap '' TERM\nwhile true; do sleep 0.05; done"), "worker"}});
  ASSERT_TRUE(soon([&] { return starts(folder).size() == 1; }));
  const auto start = steady_clock::now();
  supervisor.stop(300);
  EXPECT_LT(steady_clock::now() - start, milliseconds(5000));
  EXPECT_FALSE(alive(starts(folder)[0]));
}

TEST(DaemonObject, RemovesUploadsThatNobodyUses) {
  const TemporaryFolder folder;
  ServeConfig config = quiet(folder);
  config.keep_unused_days = 0.3 / (24 * 3600);
  Daemon daemon(config);
  StoreOptions kept;
  kept.directory = config.store_directory;
  const std::unique_ptr<Store> store = open_sqlite_store(kept);
  const std::string digest = store->put_blob(std::vector<std::byte>(100));
  EXPECT_TRUE(soon([&] { return !store->has_blob(digest); }));
  EXPECT_TRUE(soon([&] {
    return get(daemon.port(), "/metrics").body.find("lightkiln_collected_blobs_total 1\n") !=
           std::string::npos;
  }));
}

// --- the process
// ----------------------------------------------------------------------------------

std::string kilnd() {
  return std::string(LIGHTKILN_BINARY_DIR) + "/kilnd";
}

// A `kilnd serve` as a child process.
class Process {
 public:
  Process(const TemporaryFolder& folder, std::vector<std::string> more,
          std::vector<std::string> sandbox = {"--allow-missing-sandbox", "all"})
      : port_file_(folder.path() / "port") {
    std::vector<std::string> words = {
        kilnd(),       "serve",       "--store",  folder.path() / "store", "--listen",
        "127.0.0.1:0", "--port-file", port_file_, "--log-level",           "error"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), sandbox.begin(), sandbox.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    process = fork();
    if (process == 0) {
      execv(argv[0], argv.data());
      _exit(127);
    }
  }
  ~Process() {
    if (process <= 0) return;
    kill(process, SIGKILL);
    waitpid(process, nullptr, 0);
  }
  int port() {
    int found = 0;
    soon([&] { return static_cast<bool>(std::ifstream(port_file_) >> found); });
    return found;
  }
  // The exit code, or minus the signal; waits.
  int end() {
    int status = 0;
    waitpid(process, &status, 0);
    process = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  pid_t process = 0;

 private:
  std::string port_file_;
};

std::vector<pid_t> children_of(pid_t process) {
  std::ifstream in("/proc/" + std::to_string(process) + "/task/" + std::to_string(process) +
                   "/children");
  std::vector<pid_t> all;
  for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::ifstream children(task.path() / "children");
    for (pid_t one; children >> one;) all.push_back(one);
  }
  return all;
}

class ProcessTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kilnd())) GTEST_SKIP() << "kilnd is not built beside the tests";
  }
  const TemporaryFolder folder;
};

TEST_F(ProcessTest, EndsWellOnSigterm) {
  Process daemon(folder, {"--workers", "0"});
  ASSERT_EQ(get(daemon.port(), "/livez").status, 200);
  RawClient idle(daemon.port());
  kill(daemon.process, SIGTERM);
  EXPECT_EQ(daemon.end(), 0);
}

TEST_F(ProcessTest, ItsWorkersEndWithItHoweverItEnds) {
  for (const int signal : {SIGTERM, SIGKILL}) {
    const TemporaryFolder own;
    Process daemon(own, {"--workers", "2"});
    ASSERT_EQ(get(daemon.port(), "/livez").status, 200);
    ASSERT_TRUE(soon([&] { return children_of(daemon.process).size() == 2; }));
    const std::vector<pid_t> workers = children_of(daemon.process);
    // Until a worker has asked to be told of its parent's death it checks its parent once; both
    // ways it must end.
    kill(daemon.process, signal);
    EXPECT_EQ(daemon.end(), signal == SIGTERM ? 0 : -SIGKILL);
    for (const pid_t worker : workers)
      EXPECT_TRUE(soon([&] { return !alive(worker); })) << "after signal " << signal;
  }
}

TEST_F(ProcessTest, DoesNotStartWhereTheSandboxOfItsOvensIsIncomplete) {
  const std::string frames = folder.path() / "frames", oven = folder.path() / "oven";
  const std::string hello = PayloadWriter().number(1).text("landlock").take();
  std::ofstream(frames) << frame_header(FrameType::hello, hello.size()) << hello;
  std::ofstream(oven) << "#!/bin/sh\n/bin/cat " << frames << " >&3\nexec /bin/cat <&3 >/dev/null\n";
  fs::permissions(oven, fs::perms::owner_all);
  const std::vector<std::string> words = {"--workers", "1", "--oven", oven};
  EXPECT_EQ(Process(folder, words, {}).end(), 1);
  EXPECT_FALSE(fs::exists(folder.path() / "port"));
  Process allowed(folder, words, {"--allow-missing-sandbox", "landlock"});
  EXPECT_GT(allowed.port(), 0);
}

TEST_F(ProcessTest, ASecondSignalEndsItAtOnce) {
  Process daemon(folder, {"--workers", "0"});
  const int port = daemon.port();
  // An upload that does not go on holds the first stop up.
  RawClient busy(port);
  busy.send("PUT /v1/blobs/sha256:" + std::string(64, '0') +
            " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 90000000\r\n\r\nx");
  std::this_thread::sleep_for(milliseconds(300));
  const auto start = steady_clock::now();
  kill(daemon.process, SIGTERM);
  std::this_thread::sleep_for(milliseconds(500));
  EXPECT_TRUE(alive(daemon.process));
  kill(daemon.process, SIGTERM);
  EXPECT_EQ(daemon.end(), 1);
  EXPECT_LT(steady_clock::now() - start, milliseconds(4000));
}

TEST_F(ProcessTest, WatchesItsParent) {
  int pipes[2];
  ASSERT_EQ(pipe2(pipes, O_CLOEXEC), 0);
  const pid_t parent = fork();
  if (parent == 0) {
    auto* daemon = new Process(folder, {"--workers", "0", "--parent-watch"});
    daemon->port();
    (void)!write(pipes[1], &daemon->process, sizeof daemon->process);
    _exit(0);
  }
  pid_t daemon = 0;
  ASSERT_EQ(read(pipes[0], &daemon, sizeof daemon), static_cast<ssize_t>(sizeof daemon));
  waitpid(parent, nullptr, 0);
  EXPECT_TRUE(soon([&] { return !alive(daemon); }));
  close(pipes[0]);
  close(pipes[1]);
}

TEST_F(ProcessTest, LoadsNoRayTracer) {
  Process daemon(folder, {"--workers", "0"});
  ASSERT_GT(daemon.port(), 0);
  std::ifstream maps("/proc/" + std::to_string(daemon.process) + "/maps");
  const std::string text{std::istreambuf_iterator<char>(maps), {}};
  EXPECT_NE(text.find("libsqlite3"), std::string::npos);
  EXPECT_EQ(text.find("embree"), std::string::npos);
}

}  // namespace
}  // namespace lightkiln::test
