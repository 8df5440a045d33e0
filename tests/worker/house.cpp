#include "tests/worker/house.h"

#include <cctype>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "proto/json.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln::test {

namespace {

// Far beyond any wait that ends well.
#ifdef LIGHTKILN_SANITIZED
constexpr double kHangs_s = 240;
#else
constexpr double kHangs_s = 60;
#endif

}  // namespace

std::vector<std::byte> box_on_a_floor(int divisions) {
  const MeshData scene = merged(make_grid(4, divisions), make_box({-1, 0.5f, -1}, {1, 2, 1}));
  return make_glb(scene);
}
std::vector<std::byte> one_triangle() {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  mesh.triangles = {{0, 1, 2}};
  return make_glb(mesh);
}

std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    if (!std::isdigit(entry.path().filename().string()[0])) continue;
    std::ifstream in(entry.path() / "stat");
    std::string text;
    std::getline(in, text, '\0');
    const size_t close = text.rfind(')');
    if (close == std::string::npos) continue;
    std::istringstream fields(text.substr(close + 1));
    char state = 0;
    pid_t ppid = 0;
    fields >> state >> ppid;
    if (ppid == parent && state != 'Z')
      children.push_back(static_cast<pid_t>(std::stol(entry.path().filename())));
  }
  return children;
}

bool is_running(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(in, text, '\0');
  const size_t close = text.rfind(')');
  return close != std::string::npos && text[close + 2] != 'Z';
}

bool eventually(const std::function<bool()>& condition) {
  const double deadline_s = wall_seconds() + kHangs_s;
  while (!condition()) {
    if (wall_seconds() > deadline_s) return false;
    usleep(1000);
  }
  return true;
}

House::House() {
  StoreOptions options;
  options.directory = directory();
  options.min_free_bytes = 0;
  store_ = open_sqlite_store(options);
}

House::~House() {
  for (const pid_t worker : processes_) {
    kill(worker, SIGKILL);
    waitpid(worker, nullptr, 0);
  }
}

std::string House::order(const std::vector<std::byte>& glb, const std::string& rest,
                         bool plan_only) {
  const std::string digest = store_->put_blob(glb);
  const ParsedSpec parsed = parse_spec(R"({"kind":"ambient_occlusion","inputs":{"scene":")" +
                                       digest + R"("},)" + rest + "}");
  EXPECT_TRUE(parsed.faults.empty()) << parsed.faults.front().message;
  Submission submission;
  submission.kind = "ambient_occlusion";
  submission.spec_json = canonical_spec(parsed.spec);
  submission.spec_digest = spec_digest(submission.spec_json);
  submission.inputs = input_digests(parsed.spec);
  submission.plan_only = plan_only;
  submission.target_error = target_error(parsed.spec);
  return store_->submit(submission).job_id;
}

WorkerOptions House::worker_options() const {
  WorkerOptions options;
  options.store_directory = directory();
  options.oven_path = LIGHTKILN_BINARY_DIR "/kiln-oven";
  options.threads = 2;
  options.chunk_seconds = 0.002;
  options.exit_when_idle = true;
  options.allow_missing_sandbox = {"all"};  // what is missing here, tests/oven finds out
  return options;
}

JobRecord House::bake(const std::string& id, const WorkerOptions& options) {
  EXPECT_EQ(run_worker(options), 0);
  return job(id);
}

pid_t House::start_worker(WorkerOptions options) {
  options.exit_when_idle = false;
  const pid_t pid = fork();
  if (pid == 0) {
    int code = 1;
    try {
      code = run_worker(options);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "worker: %s\n", error.what());
    }
    _exit(code);
  }
  processes_.insert(pid);
  return pid;
}

pid_t House::start_daemon() {
  const std::string store = directory();
  const pid_t pid = fork();
  if (pid == 0) {
    execl(LIGHTKILN_BINARY_DIR "/kilnd", "kilnd", "serve", "--store", store.c_str(), "--listen",
          "127.0.0.1:0", "--threads", "2", "--chunk-seconds", "0.002", "--log-level", "error",
          "--allow-missing-sandbox", "all", nullptr);
    _exit(127);
  }
  processes_.insert(pid);
  return pid;
}

int House::end_process(pid_t pid, int signal) {
  kill(pid, signal);
  int status = 0;
  waitpid(pid, &status, 0);
  processes_.erase(pid);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

std::map<std::string, std::string> House::timeless_digests(const std::string& id) {
  std::map<std::string, std::string> digests;
  for (const ArtifactRecord& artifact : store_->artifacts(id))
    if (artifact.role != "plan" && artifact.role != "accuracy")
      digests[artifact.name] = artifact.digest;
  return digests;
}

std::map<std::string, int> House::chunk_commits(const std::string& id) {
  std::map<std::string, int> commits;
  for (const EventRecord& event : store_->events(id, 0, 10000))
    if (event.type == "chunk") ++commits[event.json.substr(0, event.json.find(','))];
  return commits;
}

void House::expect_every_chunk_once(const std::string& id) {
  const std::map<std::string, int> commits = chunk_commits(id);
  EXPECT_EQ(commits.size(), job(id).chunks_total);
  for (const auto& [index, count] : commits) EXPECT_EQ(count, 1) << index;
}

const std::map<std::string, std::string>& undisturbed() {
  static const std::map<std::string, std::string> digests = [] {
    House house;
    WorkerOptions options = house.worker_options();
    options.threads = 1;
    options.chunk_seconds = 1000;
    const std::string id = house.order(box_on_a_floor(60), kCoarse);
    EXPECT_EQ(house.bake(id, options).state, JobState::succeeded);
    EXPECT_EQ(house.job(id).chunks_total, 1u);
    return house.timeless_digests(id);
  }();
  return digests;
}

}  // namespace lightkiln::test
