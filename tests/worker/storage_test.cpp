// Disks that rot and disks that are full, seen by a worker.

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/worker/house.h"

namespace lightkiln::test {
namespace {

std::vector<std::byte> rot() {
  return std::vector<std::byte>(4, std::byte{'x'});
}

TEST(Worker, ADamagedInputIsTheClientsToSendAgain) {
  House house;
  const std::vector<std::byte> glb = one_triangle();
  const std::string id = house.order(glb, kCoarse);
  const std::string digest = house.store().put_blob(glb);
  const std::string hex = digest.substr(7);
  write_file(house.directory() + "/blobs/" + hex.substr(0, 2) + "/" + hex, rot());
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
  EXPECT_EQ(house.end_process(worker, SIGTERM), 0);
  ASSERT_EQ(house.job(id).state, JobState::running);
  int damaged = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(house.directory() + "/blobs"))
    if (entry.is_regular_file() && entry.path().filename() != input) {
      write_file(entry.path(), rot());
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
    for (std::string line; std::getline(in, line);)
      count += line.find("sandbox lacks") == std::string::npos;  // sanitizers rule layers out
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
  const TemporaryFolder disk, outside;
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

}  // namespace
}  // namespace lightkiln::test
