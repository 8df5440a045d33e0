// What the store promises when processes share it, and when they are killed.

#include <csignal>
#include <filesystem>
#include <functional>
#include <random>
#include <set>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/store/database.h"
#include "server/store/process_identity.h"
#include "server/store/storage_failure.h"
#include "server/store/store.h"
#include "tests/store/whole.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

class StoreProcesses : public testing::Test {
 protected:
  std::unique_ptr<Store> open(int64_t lease_ms = 3'600'000) {
    StoreOptions options;
    options.directory = (folder.path() / "store").string();
    options.lease_ms = lease_ms;
    options.min_free_bytes = 0;
    return open_sqlite_store(options);
  }
  static Submission order(int number) {
    Submission submission;
    submission.kind = "ambient_occlusion";
    submission.spec_json = "{}";
    submission.spec_digest = "spec " + std::to_string(number);
    return submission;
  }
  static pid_t child(const std::function<void()>& body) {
    const pid_t pid = fork();
    if (pid != 0) return pid;
    try {
      body();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "child: %s\n", error.what());
      _exit(1);
    }
    _exit(0);
  }
  static int wait_for(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  test::TemporaryFolder folder;
};

TEST_F(StoreProcesses, KillNineLosesNoAcknowledgedJob) {
  std::mt19937 random(7);
  std::vector<std::string> acknowledged;
  for (int round = 0; round < 25; ++round) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t writer = child([&] {
      const auto store = open();
      for (int i = 0;; ++i) {
        const std::string id = store->submit(order(i)).job_id;
        const std::string digest =
            store->put_blob(std::vector<std::byte>(100, static_cast<std::byte>(i)));
        const std::string line = id + " " + digest + "\n";
        if (write(ends[1], line.data(), line.size()) < 0) return;
      }
    });
    ::close(ends[1]);
    std::string heard(120, '\0');  // wait for the first line, so that every round acknowledges
    ssize_t got = read(ends[0], heard.data(), heard.size());
    usleep(static_cast<useconds_t>(random() % 15'000));
    kill(writer, SIGKILL);
    EXPECT_EQ(wait_for(writer), -SIGKILL);
    std::string all(heard, 0, static_cast<size_t>(std::max<ssize_t>(got, 0)));
    while ((got = read(ends[0], heard.data(), heard.size())) > 0)
      all.append(heard, 0, static_cast<size_t>(got));
    ::close(ends[0]);
    for (size_t begin = 0, end; (end = all.find('\n', begin)) != std::string::npos; begin = end + 1)
      acknowledged.push_back(all.substr(begin, end - begin));
  }
  const auto store = open();
  EXPECT_GE(acknowledged.size(), 25u);
  for (const std::string& line : acknowledged) {
    EXPECT_TRUE(store->find_job(line.substr(0, 26))) << line;
    ::close(store->open_blob(line.substr(27), nullptr));
  }
  RecordProperty("acknowledged", static_cast<int>(acknowledged.size()));
}

TEST_F(StoreProcesses, ATaskOfAKilledWorkerIsClaimableAtOnce) {
  const auto store = open();
  const std::string id = store->submit(order(1)).job_id;
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t worker = child([&] {
    const auto own = open();
    const bool claimed = own->claim("doomed", "").has_value();
    if (write(ends[1], claimed ? "y" : "n", 1) < 0) return;
    pause();
  });
  char answer = 0;
  ASSERT_EQ(read(ends[0], &answer, 1), 1);
  ASSERT_EQ(answer, 'y');
  EXPECT_FALSE(store->claim("rescuer", "")) << "its holder lives and the lease is an hour long";
  kill(worker, SIGKILL);
  EXPECT_EQ(wait_for(worker), -SIGKILL);
  store->wait_for_work(60'000);
  const std::optional<Claim> rescued = store->claim("rescuer", "");
  ASSERT_TRUE(rescued);
  EXPECT_EQ(rescued->job_id, id);
  EXPECT_EQ(store->find_job(id)->attempts, 0) << "a lost worker is no crash of the input";
}

TEST_F(StoreProcesses, ManyProcessesShareTheWorkWithoutDoingAnyTwice) {
  constexpr int kWorkers = 4, kJobs = 30, kChunks = 3;
  std::vector<pid_t> workers;
  for (int w = 0; w < kWorkers; ++w)
    workers.push_back(child([&, w] {
      const auto store = open();
      for (int i = 0; i < kJobs / kWorkers + 1; ++i) store->submit(order(w * 1000 + i));
      const std::string name = "worker " + std::to_string(w);
      int idle = 0;
      while (idle < 5) {
        const std::optional<Claim> claim = store->claim(name, "");
        idle = claim ? 0 : idle + 1;
        if (!claim) {
          store->wait_for_work(50);
        } else if (claim->type == TaskType::plan) {
          store->commit_plan(*claim, "{}", kChunks, 1);
        } else if (claim->type == TaskType::chunk) {
          const std::string text = claim->job_id + std::to_string(claim->chunk_index);
          const auto* data = reinterpret_cast<const std::byte*>(text.data());
          store->commit_chunk(*claim, {{data, data + text.size()}, "{}", 1, 0.01});
        } else {
          EXPECT_EQ(test::load_chunks(*store, claim->job_id).size(), static_cast<size_t>(kChunks));
          test::commit_result(*store, *claim, {{"a", "image", "image/x-exr", {std::byte{1}}}},
                              "{}");
        }
      }
    }));
  for (const pid_t worker : workers) EXPECT_EQ(wait_for(worker), 0);
  const auto store = open();
  JobFilter all;
  all.limit = 500;
  const std::vector<JobRecord> jobs = store->list_jobs(all);
  EXPECT_EQ(jobs.size(), static_cast<size_t>(kWorkers * (kJobs / kWorkers + 1)));
  for (const JobRecord& job : jobs) {
    EXPECT_EQ(job.state, JobState::succeeded);
    EXPECT_EQ(job.chunks_done, static_cast<uint64_t>(kChunks));
    std::set<std::string> chunks;
    for (const EventRecord& event : store->events(job.id, 0, 100))
      if (event.type == "chunk") {
        EXPECT_TRUE(chunks.insert(event.json).second);
      }
    EXPECT_EQ(chunks.size(), static_cast<size_t>(kChunks));
  }
}

TEST_F(StoreProcesses, ASubmissionWakesAnotherProcess) {
  const auto store = open();
  const pid_t client = child([&] {
    usleep(50'000);
    open()->submit(order(1));
  });
  store->wait_for_work(60'000);
  EXPECT_TRUE(store->claim("w", ""));
  EXPECT_EQ(wait_for(client), 0);
}

TEST_F(StoreProcesses, DraftsOfDeadProcessesAreSwept) {
  const pid_t writer = child([&] {
    const auto store = open();
    const auto upload = store->begin_upload();
    upload->append("half", 4);
    _exit(0);
  });
  EXPECT_EQ(wait_for(writer), 0);
  const auto incoming = folder.path() / "store" / "blobs" / "incoming";
  const auto files = [&] {
    return std::distance(std::filesystem::directory_iterator(incoming), {});
  };
  EXPECT_EQ(files(), 1);
  const auto store = open();
  EXPECT_EQ(files(), 0);
  const auto living = store->begin_upload();
  const auto second = open();
  EXPECT_EQ(files(), 1) << "a living process keeps its draft";
}

TEST_F(StoreProcesses, ANewerSchemaIsRefused) {
  open();
  {
    Database db((folder.path() / "store" / "store.sqlite").string(), Database::Access::write);
    db.execute("PRAGMA user_version=99");
  }
  try {
    open();
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unavailable);
    EXPECT_NE(std::string(error.what()).find("newer"), std::string::npos);
  }
}

TEST_F(StoreProcesses, ADamagedDatabaseIsRefused) {
  {
    const auto store = open();
    for (int i = 0; i < 200; ++i) store->submit(order(i));
  }
  const auto path = folder.path() / "store" / "store.sqlite";
  open();  // moves the log into the file
  std::vector<std::byte> bytes = test::read_file(path);
  ASSERT_GT(bytes.size(), 20'000u);
  for (size_t i = 8192; i < 16'384; ++i) bytes[i] = std::byte{0x5a};
  test::write_file(path, bytes);
  EXPECT_THROW(open(), Error);
}

TEST(StorageFailure, AFailedFsyncEndsTheProcessWithItsOwnCode) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(fsync_or_stop(-1, "the blob"), testing::ExitedWithCode(kExitStorageFailed),
              "storage failed: fsync of the blob");
}

TEST(ProcessIdentity, ThisProcessLivesAndAnEndedOneIsDead) {
  EXPECT_FALSE(is_provably_dead(own_process_identity()));
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t pid = fork();
  if (pid == 0) {
    const std::string own = own_process_identity();
    _exit(write(ends[1], own.data(), own.size()) < 0);
  }
  std::string identity(200, '\0');
  identity.resize(static_cast<size_t>(read(ends[0], identity.data(), identity.size())));
  siginfo_t info{};
  waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT);
  EXPECT_TRUE(is_provably_dead(identity)) << "a zombie does no work";
  waitpid(pid, nullptr, 0);
  EXPECT_TRUE(is_provably_dead(identity));
  EXPECT_FALSE(is_provably_dead("elsewhere/1/2/3"));
  EXPECT_FALSE(is_provably_dead("nonsense"));
}

}  // namespace
}  // namespace lightkiln
