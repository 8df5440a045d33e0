// Orders through a real worker and a real oven: results, failures, and kill -9 at every stage.

#include "server/worker/worker.h"

#include <cctype>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "proto/json.h"
#include "server/store/store.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln {
namespace {

constexpr double kHangs_s = 60;  // far beyond any wait that ends well

std::vector<std::byte> box_on_a_floor(int divisions) {
  const test::MeshData scene =
      test::merged(test::make_grid(4, divisions), test::make_box({-1, 0.5f, -1}, {1, 2, 1}));
  return test::make_glb(scene);
}
std::vector<std::byte> one_triangle() {
  test::MeshData mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  mesh.triangles = {{0, 1, 2}};
  return test::make_glb(mesh);
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

// Looks every millisecond until `condition` holds; false when it never does.
bool eventually(const std::function<bool()>& condition) {
  const double deadline_s = wall_seconds() + kHangs_s;
  while (!condition()) {
    if (wall_seconds() > deadline_s) return false;
    usleep(1000);
  }
  return true;
}

class House {
 public:
  House() {
    StoreOptions options;
    options.directory = directory();
    options.min_free_bytes = 0;
    store_ = open_sqlite_store(options);
  }
  ~House() {
    for (const pid_t worker : workers_) {
      kill(worker, SIGKILL);
      waitpid(worker, nullptr, 0);
    }
  }
  House(const House&) = delete;
  House& operator=(const House&) = delete;

  Store& store() { return *store_; }
  std::string directory() const { return (folder_.path() / "store").string(); }

  std::string order(const std::vector<std::byte>& glb, const std::string& rest,
                    bool plan_only = false) {
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

  WorkerOptions worker_options() const {
    WorkerOptions options;
    options.store_directory = directory();
    options.oven_path = LIGHTKILN_BINARY_DIR "/kiln-oven";
    options.threads = 2;
    options.chunk_seconds = 0.002;
    options.exit_when_idle = true;
    options.allow_missing_sandbox = {"all"};  // what is missing here, tests/oven finds out
    return options;
  }
  JobRecord bake(const std::string& id, const WorkerOptions& options) {
    EXPECT_EQ(run_worker(options), 0);
    return job(id);
  }
  JobRecord job(const std::string& id) { return store_->find_job(id).value(); }

  pid_t start_worker(WorkerOptions options) {
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
    workers_.insert(pid);
    return pid;
  }
  // A daemon with one worker, on a free port.
  pid_t start_daemon() {
    const std::string store = directory();
    const pid_t pid = fork();
    if (pid == 0) {
      execl(LIGHTKILN_BINARY_DIR "/kilnd", "kilnd", "serve", "--store", store.c_str(), "--listen",
            "127.0.0.1:0", "--threads", "2", "--chunk-seconds", "0.002", "--log-level", "error",
            "--allow-missing-sandbox", "all", nullptr);
      _exit(127);
    }
    workers_.insert(pid);
    return pid;
  }
  int end_worker(pid_t pid, int signal) {
    kill(pid, signal);
    int status = 0;
    waitpid(pid, &status, 0);
    workers_.erase(pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  // What must not depend on how a job went: everything but the times in plan and accuracy.
  std::map<std::string, std::string> timeless_digests(const std::string& id) {
    std::map<std::string, std::string> digests;
    for (const ArtifactRecord& artifact : store_->artifacts(id))
      if (artifact.role != "plan" && artifact.role != "accuracy")
        digests[artifact.name] = artifact.digest;
    return digests;
  }
  // Every chunk's commits, by index.
  std::map<std::string, int> chunk_commits(const std::string& id) {
    std::map<std::string, int> commits;
    for (const EventRecord& event : store_->events(id, 0, 10000))
      if (event.type == "chunk") ++commits[event.json.substr(0, event.json.find(','))];
    return commits;
  }
  void expect_every_chunk_once(const std::string& id) {
    const std::map<std::string, int> commits = chunk_commits(id);
    EXPECT_EQ(commits.size(), job(id).chunks_total);
    for (const auto& [index, count] : commits) EXPECT_EQ(count, 1) << index;
  }

 private:
  test::TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
  std::set<pid_t> workers_;
};

constexpr const char* kCoarse = R"("accuracy":{"target_error":0.03})";
constexpr const char* kFine = R"("accuracy":{"target_error":0.0005,"max_samples":1048576})";

// The undisturbed truth that kills, threads and chunk sizes are held against.
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

TEST(Worker, BakesFromSubmissionToArtifacts) {
  House house;
  const std::string id = house.order(one_triangle(), kCoarse);
  const JobRecord job = house.bake(id, house.worker_options());
  ASSERT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : job.reason);
  EXPECT_FALSE(job.plan_json.empty());
  EXPECT_FALSE(job.accuracy_json.empty());
  std::set<std::string> roles, names;
  for (const ArtifactRecord& artifact : house.store().artifacts(id)) {
    roles.insert(artifact.role);
    names.insert(artifact.name);
    EXPECT_GT(artifact.bytes, 0u);
  }
  for (const char* role : {"document", "plan", "accuracy", "preview"})
    EXPECT_TRUE(roles.contains(role)) << role;
  for (const char* name : {"ambient_occlusion.json", "plan.json", "accuracy.json"})
    EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Worker, APlanOnlyOrderBakesNothing) {
  House house;
  const std::string id = house.order(one_triangle(), kCoarse, true);
  const JobRecord job = house.bake(id, house.worker_options());
  EXPECT_EQ(job.state, JobState::succeeded);
  EXPECT_FALSE(job.plan_json.empty());
  EXPECT_EQ(job.chunks_done, 0u);
}

TEST(Worker, TheSameBytesForAnyThreadsAndChunkSizes) {
  ASSERT_FALSE(undisturbed().empty());
  for (const int threads : {1, 2, 8})
    for (const double chunk_seconds : {1000.0, 0.002}) {
      House house;
      WorkerOptions options = house.worker_options();
      options.threads = threads;
      options.chunk_seconds = chunk_seconds;
      const std::string id = house.order(box_on_a_floor(60), kCoarse);
      const JobRecord job = house.bake(id, options);
      EXPECT_EQ(job.state, JobState::succeeded);
      if (chunk_seconds < 1) {
        EXPECT_GT(job.chunks_total, 1u);
      }
      EXPECT_EQ(house.timeless_digests(id), undisturbed()) << threads << " " << chunk_seconds;
    }
}

TEST(Worker, AMalformedSceneFailsWithItsPlace) {
  House house;
  const std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
      R"("accessors":[{"componentType":5126,"count":3,"type":"VEC3","bufferView":9}]})";
  const std::string id = house.order(test::make_glb_container(json, {}), kCoarse);
  const JobRecord job = house.bake(id, house.worker_options());
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "invalid_input");
  EXPECT_NE(job.error->pointer.find("/accessors/0"), std::string::npos) << job.error->pointer;
  EXPECT_FALSE(job.error->detail.empty());
  EXPECT_EQ(job.attempts, 1) << "an input's fault is not tried again";
}

TEST(Worker, AHungryInputEndsAsOutOfMemoryAfterTwoTries) {
  House house;
  WorkerOptions options = house.worker_options();
  options.oven_memory_bytes = 4096;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  const JobRecord job = house.bake(id, options);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "out_of_memory") << job.error->detail;
  EXPECT_EQ(job.attempts, 2);
}

TEST(Worker, AnEndlessTaskTimesOutAfterTwoTries) {
  House house;
  WorkerOptions options = house.worker_options();
  options.task_seconds = 0.3;
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const JobRecord job = house.bake(id, options);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "timed_out") << job.error->detail;
  EXPECT_EQ(job.attempts, 2);
}

TEST(Worker, AnOvenThatDiesTwiceFailsTheJobAndNamesTheSignal) {
  House house;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const pid_t worker = house.start_worker(house.worker_options());
  ASSERT_TRUE(eventually([&] {
    if (house.job(id).state == JobState::running)
      for (const pid_t oven : children_of(worker)) kill(oven, SIGSEGV);
    return is_terminal(house.job(id).state);
  }));
  const JobRecord job = house.job(id);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "oven_crashed");
  EXPECT_NE(job.error->detail.find("SIGSEGV"), std::string::npos) << job.error->detail;
  EXPECT_EQ(job.attempts, 2);
  const std::string after = house.order(one_triangle(), kCoarse);
  EXPECT_TRUE(eventually([&] { return house.job(after).state == JobState::succeeded; }))
      << "the worker goes on with the next order";
}

TEST(Worker, KilledOvensLoseOnlyTheChunkInHand) {
  std::mt19937 random(11);
  House house;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  const pid_t worker = house.start_worker(house.worker_options());
  int kills = 0;
  uint64_t next_kill = 0;
  ASSERT_TRUE(eventually([&] {
    const JobRecord job = house.job(id);
    // Two commits between two kills: the second crash of one task would rightly fail the job.
    if (job.state == JobState::running && job.chunks_done >= next_kill) {
      usleep(static_cast<useconds_t>(random() % 15'000));
      const std::vector<pid_t> ovens = children_of(worker);  // at work and in reserve
      if (!ovens.empty()) kill(ovens[random() % ovens.size()], SIGKILL);
      next_kill = house.job(id).chunks_done + 2;
      ++kills;
    }
    return is_terminal(house.job(id).state);
  }));
  const JobRecord job = house.job(id);
  EXPECT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : "");
  EXPECT_GT(kills, 2);
  house.expect_every_chunk_once(id);
  EXPECT_EQ(house.timeless_digests(id), undisturbed());
}

TEST(Worker, KilledWorkersLoseOnlyTheChunkInHandAndTakeTheirOvensAlong) {
  std::mt19937 random(13);
  House house;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  int kills = 0;
  for (; kills < 40 && !is_terminal(house.job(id).state); ++kills) {
    const pid_t worker = house.start_worker(house.worker_options());
    const uint64_t done = house.job(id).chunks_done;
    // Progress between two kills: the third lost lease of one task would rightly fail the job.
    ASSERT_TRUE(eventually(
        [&] { return house.job(id).chunks_done != done || is_terminal(house.job(id).state); }));
    usleep(static_cast<useconds_t>(random() % 20'000));
    const std::vector<pid_t> ovens = children_of(worker);
    EXPECT_EQ(house.end_worker(worker, SIGKILL), -SIGKILL);
    for (const pid_t oven : ovens) EXPECT_TRUE(eventually([&] { return !is_running(oven); }));
  }
  if (!is_terminal(house.job(id).state)) house.bake(id, house.worker_options());
  const JobRecord job = house.job(id);
  EXPECT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : "");
  EXPECT_EQ(job.attempts, 0) << "a lost worker is no crash of the input";
  EXPECT_GT(kills, 2);
  house.expect_every_chunk_once(id);
  EXPECT_EQ(house.timeless_digests(id), undisturbed());
}

TEST(Worker, KilledDaemonsTakeTheirWorkersAlongAndTheJobGoesOn) {
  std::mt19937 random(17);
  House house;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  int kills = 0;
  for (; kills < 40 && !is_terminal(house.job(id).state); ++kills) {
    const pid_t daemon = house.start_daemon();
    const uint64_t done = house.job(id).chunks_done;
    ASSERT_TRUE(eventually(
        [&] { return house.job(id).chunks_done != done || is_terminal(house.job(id).state); }));
    usleep(static_cast<useconds_t>(random() % 20'000));
    std::vector<pid_t> below = children_of(daemon);
    for (const pid_t worker : children_of(daemon))
      for (const pid_t oven : children_of(worker)) below.push_back(oven);
    EXPECT_GE(below.size(), 1u);
    EXPECT_EQ(house.end_worker(daemon, SIGKILL), -SIGKILL);
    for (const pid_t process : below) {
      EXPECT_TRUE(eventually([&] { return !is_running(process); }));
    }
  }
  if (!is_terminal(house.job(id).state)) house.bake(id, house.worker_options());
  EXPECT_EQ(house.job(id).state, JobState::succeeded);
  EXPECT_GT(kills, 1);
  house.expect_every_chunk_once(id);
  EXPECT_EQ(house.timeless_digests(id), undisturbed());
}

TEST(Worker, ACancelMidBakeEndsTheOven) {
  House house;
  WorkerOptions options = house.worker_options();
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const pid_t worker = house.start_worker(options);
  ASSERT_TRUE(eventually([&] { return house.job(id).stage == JobStage::bake; }));
  usleep(200'000);
  const std::vector<pid_t> before = children_of(worker);
  ASSERT_EQ(before.size(), 2u) << "one at work, one in reserve";
  const double cancelled_s = wall_seconds();
  house.store().cancel(id);
  ASSERT_TRUE(eventually([&] { return !is_running(before[0]) || !is_running(before[1]); }));
  RecordProperty("milliseconds", static_cast<int>((wall_seconds() - cancelled_s) * 1000));
  EXPECT_EQ(house.job(id).state, JobState::cancelled);
  const std::string after = house.order(one_triangle(), kCoarse);
  EXPECT_TRUE(eventually([&] { return house.job(after).state == JobState::succeeded; }));
}

TEST(Worker, SigtermGivesTheClaimBackUncounted) {
  House house;
  WorkerOptions options = house.worker_options();
  options.chunk_seconds = 1000;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  for (int i = 0; i < 4; ++i) {
    const pid_t worker = house.start_worker(options);
    ASSERT_TRUE(eventually([&] {
      return house.job(id).stage == JobStage::bake &&
             house.store().counts().at("leased_tasks") == 1;
    }));
    EXPECT_EQ(house.end_worker(worker, SIGTERM), 0);
    EXPECT_EQ(house.job(id).state, JobState::running);
    EXPECT_NE(house.job(id).reason.find("shut down"), std::string::npos);
  }
  EXPECT_EQ(house.job(id).attempts, 0);
}

std::vector<std::byte> rot() {
  return std::vector<std::byte>(4, std::byte{'x'});
}

TEST(Worker, ADamagedInputIsTheClientsToSendAgain) {
  House house;
  const std::vector<std::byte> glb = one_triangle();
  const std::string id = house.order(glb, kCoarse);
  const std::string digest = house.store().put_blob(glb);
  const std::string hex = digest.substr(7);
  test::write_file(house.directory() + "/blobs/" + hex.substr(0, 2) + "/" + hex, rot());
  JobRecord job = house.bake(id, house.worker_options());
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "invalid_input");
  EXPECT_EQ(job.error->detail, "The stored input " + digest + " is damaged; upload it again.");
  house.store().retry(id);
  job = house.bake(id, house.worker_options());
  EXPECT_EQ(job.error->detail, "The stored input " + digest + " is gone; upload it again.");
  house.store().put_blob(glb);
  house.store().retry(id);
  EXPECT_EQ(house.bake(id, house.worker_options()).state, JobState::succeeded);
}

TEST(Worker, DamagedChunksAreBakedAgainAndTheResultIsTheSame) {
  House house;
  const std::vector<std::byte> glb = box_on_a_floor(60);
  const std::string id = house.order(glb, kCoarse);
  const std::string input = house.store().put_blob(glb).substr(7);
  const pid_t worker = house.start_worker(house.worker_options());
  ASSERT_TRUE(eventually([&] { return house.job(id).chunks_done >= 2; }));
  EXPECT_EQ(house.end_worker(worker, SIGTERM), 0);
  ASSERT_EQ(house.job(id).state, JobState::running);
  int damaged = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(house.directory() + "/blobs"))
    if (entry.is_regular_file() && entry.path().filename() != input) {
      test::write_file(entry.path(), rot());
      ++damaged;
    }
  EXPECT_GE(damaged, 2);
  const JobRecord job = house.bake(id, house.worker_options());
  EXPECT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : job.reason);
  EXPECT_EQ(house.timeless_digests(id), undisturbed());
}

// In a child of its own: a store on a disk of 16 MiB, filled while an order waits. The number of
// the first thing that went wrong; 0 = none, kNoSmallDisk = no such disk can be had here.
constexpr int kNoSmallDisk = 77;
constexpr size_t kMaxLines = 4;
int wait_out_a_full_disk(const std::string& disk, const std::string& log) {
  const auto write_text = [](const char* path, const std::string& text) {
    std::ofstream(path) << text;
  };
  const std::string user = std::to_string(getuid()), group = std::to_string(getgid());
  if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return kNoSmallDisk;
  write_text("/proc/self/setgroups", "deny");
  write_text("/proc/self/uid_map", "0 " + user + " 1");
  write_text("/proc/self/gid_map", "0 " + group + " 1");
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=16m") != 0) return kNoSmallDisk;
  setenv("TMPDIR", disk.c_str(), 1);
  House house;
  const std::string id = house.order(one_triangle(), kCoarse);
  const std::string filler = disk + "/filler";
  {
    std::ofstream out(filler, std::ios::binary);
    const std::vector<char> page(4096, 'x');
    while (out.write(page.data(), 4096).flush()) {
    }
  }
  const pid_t worker = fork();
  if (worker == 0) {
    if (!std::freopen(log.c_str(), "w", stderr)) _exit(1);
    std::setvbuf(stderr, nullptr, _IONBF, 0);        // a reopened stream is buffered
    WorkerOptions options = house.worker_options();  // ends when idle, which it is not
    _exit(run_worker(options));
  }
  const auto lines = [&] {
    std::ifstream in(log);
    size_t count = 0;
    for (std::string line; std::getline(in, line);) ++count;
    return count;
  };
  if (!eventually([&] { return lines() > 0; })) {  // the control: it meets the full disk
    kill(worker, SIGKILL);
    return 1;
  }
  usleep(1'500'000);
  int status = 0;
  if (waitpid(worker, &status, WNOHANG) != 0) return 2;
  if (lines() > kMaxLines) return 3;
  if (is_terminal(house.job(id).state)) return 4;
  std::filesystem::remove(filler);
  waitpid(worker, &status, 0);
  if (status != 0) return 5;
  if (house.job(id).state != JobState::succeeded) return 6;
  return lines() > kMaxLines ? 7 : 0;
}

TEST(Worker, AFullDiskIsWaitedOutQuietlyAndIsNoReasonToEnd) {
  const test::TemporaryFolder disk, outside;
  const std::string log = (outside.path() / "log").string();
  const pid_t child = fork();
  if (child == 0) _exit(wait_out_a_full_disk(disk.path().string(), log));
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kNoSmallDisk) GTEST_SKIP() << "no small disk can be mounted here";
  std::ifstream in(log);
  EXPECT_EQ(WEXITSTATUS(status), 0)
      << std::string(std::istreambuf_iterator<char>(in), {}).substr(0, 2000);
}

TEST(Worker, AMissingOvenIsSaid) {
  House house;
  WorkerOptions options = house.worker_options();
  options.oven_path = "/nowhere/kiln-oven";
  try {
    run_worker(options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unavailable);
    EXPECT_NE(std::string(error.what()).find("/nowhere/kiln-oven"), std::string::npos);
  }
}

}  // namespace
}  // namespace lightkiln
