// kill -9 of the oven, the worker and the daemon at any moment.

#include <csignal>
#include <random>

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/worker/house.h"

namespace lightkiln::test {
namespace {

constexpr int kCrash = SIGILL;  // sanitizers take SIGSEGV, SIGBUS and SIGFPE for themselves

TEST(Worker, AnOvenThatDiesTwiceFailsTheJobAndNamesTheSignal) {
  House house;
  const std::string id = house.order(box_on_a_floor(100), kFine);
  const pid_t worker = house.start_worker(house.worker_options());
  ASSERT_TRUE(eventually([&] {
    if (house.job(id).state == JobState::running)
      for (const pid_t oven : children_of(worker)) kill(oven, kCrash);
    return is_terminal(house.job(id).state);
  }));
  const JobRecord job = house.job(id);
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, "oven_crashed");
  EXPECT_NE(job.error->detail.find("SIGILL"), std::string::npos) << job.error->detail;
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

// Starts `start` and kills it -9 at a random moment after it got on with the job, again and again
// until the job ends. What ran below it must end with it, and the result must be the undisturbed
// one.
void kill_until_done(unsigned seed, const std::function<pid_t(House&)>& start, int least_kills) {
  std::mt19937 random(seed);
  House house;
  const std::string id = house.order(box_on_a_floor(60), kCoarse);
  int kills = 0;
  // Counted over all kills: between one oven and the next a worker has none for a moment.
  size_t taken_along = 0;
  for (; kills < 40 && !is_terminal(house.job(id).state); ++kills) {
    const pid_t process = start(house);
    const uint64_t done = house.job(id).chunks_done;
    // Progress between two kills: the third lost lease of one task would rightly fail the job.
    ASSERT_TRUE(eventually(
        [&] { return house.job(id).chunks_done != done || is_terminal(house.job(id).state); }));
    usleep(static_cast<useconds_t>(random() % 20'000));
    std::vector<pid_t> below = children_of(process);
    for (size_t i = 0; i < below.size(); ++i)
      for (const pid_t child : children_of(below[i])) below.push_back(child);
    taken_along += below.size();
    EXPECT_EQ(house.end_process(process, SIGKILL), -SIGKILL);
    for (const pid_t one : below) EXPECT_TRUE(eventually([&] { return !is_running(one); }));
  }
  if (!is_terminal(house.job(id).state)) house.bake(id, house.worker_options());
  const JobRecord job = house.job(id);
  EXPECT_EQ(job.state, JobState::succeeded) << (job.error ? job.error->detail : "");
  EXPECT_EQ(job.attempts, 0) << "a lost worker is no crash of the input";
  EXPECT_GE(kills, least_kills);
  EXPECT_GE(taken_along, static_cast<size_t>(least_kills)) << "hardly anything ran to be taken";
  house.expect_every_chunk_once(id);
  EXPECT_EQ(house.timeless_digests(id), undisturbed());
}

TEST(Worker, KilledWorkersLoseOnlyTheChunkInHandAndTakeTheirOvensAlong) {
  kill_until_done(
      13, [](House& house) { return house.start_worker(house.worker_options()); }, 3);
}

TEST(Worker, KilledDaemonsTakeTheirWorkersAlongAndTheJobGoesOn) {
  kill_until_done(
      17, [](House& house) { return house.start_daemon(); }, 2);
}

}  // namespace
}  // namespace lightkiln::test
