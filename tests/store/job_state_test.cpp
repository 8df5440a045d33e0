#include "server/store/job_state.h"

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

using enum JobEvent;
constexpr JobState kStates[] = {JobState::queued, JobState::running, JobState::succeeded,
                                JobState::failed, JobState::cancelled};
constexpr JobStage kStages[] = {JobStage::plan, JobStage::bake, JobStage::assemble, JobStage::done};

void expect_only(JobEvent event, const std::vector<std::pair<JobPosition, JobPosition>>& allowed) {
  for (const JobState state : kStates)
    for (const JobStage stage : kStages) {
      std::optional<JobPosition> expected;
      for (const auto& [from, to] : allowed)
        if (from == JobPosition{state, stage}) expected = to;
      EXPECT_EQ(next_position({state, stage}, event), expected)
          << job_state_name(state) << " " << job_stage_name(stage);
    }
}

std::vector<std::pair<JobPosition, JobPosition>> keeping_stage(std::initializer_list<JobState> from,
                                                               JobState to) {
  std::vector<std::pair<JobPosition, JobPosition>> moves;
  for (const JobState state : from)
    for (const JobStage stage : kStages) moves.push_back({{state, stage}, {to, stage}});
  return moves;
}

TEST(JobState, ClaimStartsAnActiveJobAndKeepsItsStage) {
  expect_only(task_claimed,
              keeping_stage({JobState::queued, JobState::running}, JobState::running));
}
TEST(JobState, PlanLeadsToBaking) {
  expect_only(plan_committed,
              {{{JobState::running, JobStage::plan}, {JobState::running, JobStage::bake}}});
}
TEST(JobState, PlanEndsAnOrderForAPlan) {
  expect_only(plan_only_committed,
              {{{JobState::running, JobStage::plan}, {JobState::succeeded, JobStage::done}}});
}
TEST(JobState, LastChunkLeadsToAssembling) {
  expect_only(last_chunk_committed,
              {{{JobState::running, JobStage::bake}, {JobState::running, JobStage::assemble}}});
}
TEST(JobState, LostChunksLeadBackToBaking) {
  expect_only(chunks_lost,
              {{{JobState::running, JobStage::assemble}, {JobState::running, JobStage::bake}}});
}
TEST(JobState, ResultEndsTheJob) {
  expect_only(result_committed,
              {{{JobState::running, JobStage::assemble}, {JobState::succeeded, JobStage::done}}});
}
TEST(JobState, OnlyRunningJobsFail) {
  expect_only(failed, keeping_stage({JobState::running}, JobState::failed));
}
TEST(JobState, CancelEndsWhatIsNotEnded) {
  expect_only(cancelled, keeping_stage({JobState::queued, JobState::running}, JobState::cancelled));
}
TEST(JobState, RetryQueuesFailedAndCancelledJobsInTheirStage) {
  expect_only(retried, keeping_stage({JobState::failed, JobState::cancelled}, JobState::queued));
}
TEST(JobState, CacheAnswersOnlyAFreshJob) {
  expect_only(answered_from_cache,
              {{{JobState::queued, JobStage::plan}, {JobState::succeeded, JobStage::done}}});
}
TEST(JobState, RunningJobsCannotBeRemoved) {
  for (const JobState state : kStates) EXPECT_EQ(can_remove(state), state != JobState::running);
}
TEST(JobState, CrashesAreTriedTwice) {
  EXPECT_EQ(after_crash(1, 2), TaskVerdict::try_again);
  EXPECT_EQ(after_crash(2, 2), TaskVerdict::fail_job);
}
TEST(JobState, TheThirdLostLeaseFailsTheJob) {
  EXPECT_EQ(after_lost_lease(1), TaskVerdict::try_again);
  EXPECT_EQ(after_lost_lease(2), TaskVerdict::try_again);
  EXPECT_EQ(after_lost_lease(3), TaskVerdict::fail_job);
}

}  // namespace
}  // namespace lightkiln
