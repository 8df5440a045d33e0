#include "server/store/job_state.h"

namespace lightkiln {

const char* job_state_name(JobState state) {
  switch (state) {
    case JobState::queued:
      return "queued";
    case JobState::running:
      return "running";
    case JobState::succeeded:
      return "succeeded";
    case JobState::failed:
      return "failed";
    case JobState::cancelled:
      return "cancelled";
  }
  return "failed";
}

const char* job_stage_name(JobStage stage) {
  switch (stage) {
    case JobStage::plan:
      return "plan";
    case JobStage::bake:
      return "bake";
    case JobStage::assemble:
      return "assemble";
    case JobStage::done:
      return "done";
  }
  return "done";
}

bool is_terminal(JobState state) {
  return state == JobState::succeeded || state == JobState::failed || state == JobState::cancelled;
}

std::optional<JobPosition> next_position(const JobPosition& position, JobEvent event) {
  const auto [state, stage] = position;
  const bool active = !is_terminal(state);
  const bool running = state == JobState::running;
  switch (event) {
    case JobEvent::task_claimed:
      if (active) return JobPosition{JobState::running, stage};
      break;
    case JobEvent::plan_committed:
      if (running && stage == JobStage::plan) return JobPosition{state, JobStage::bake};
      break;
    case JobEvent::plan_only_committed:
      if (running && stage == JobStage::plan)
        return JobPosition{JobState::succeeded, JobStage::done};
      break;
    case JobEvent::last_chunk_committed:
      if (running && stage == JobStage::bake) return JobPosition{state, JobStage::assemble};
      break;
    case JobEvent::chunks_lost:
      if (running && stage == JobStage::assemble) return JobPosition{state, JobStage::bake};
      break;
    case JobEvent::result_committed:
      if (running && stage == JobStage::assemble)
        return JobPosition{JobState::succeeded, JobStage::done};
      break;
    case JobEvent::failed:
      if (running) return JobPosition{JobState::failed, stage};
      break;
    case JobEvent::cancelled:
      if (active) return JobPosition{JobState::cancelled, stage};
      break;
    case JobEvent::retried:
      if (state == JobState::failed || state == JobState::cancelled)
        return JobPosition{JobState::queued, stage};
      break;
    case JobEvent::answered_from_cache:
      if (position == JobPosition{}) return JobPosition{JobState::succeeded, JobStage::done};
      break;
  }
  return std::nullopt;
}

bool can_remove(JobState state) {
  return state != JobState::running;
}

TaskVerdict after_crash(int crashes, int max_attempts) {
  return crashes >= max_attempts ? TaskVerdict::fail_job : TaskVerdict::try_again;
}

TaskVerdict after_lost_lease(int losses) {
  return losses >= kMaxLostLeases ? TaskVerdict::fail_job : TaskVerdict::try_again;
}

}  // namespace lightkiln
