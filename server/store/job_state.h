#pragma once

// All states and their transitions, as pure functions: no clock, no database. The store applies
// what these answer and nothing else moves a job.

#include <optional>

#include "server/store/store.h"

namespace lightkiln {

enum class JobEvent {
  task_claimed,         // a worker took one of its tasks
  plan_committed,       // of an order that bakes
  plan_only_committed,  // of an order that wants nothing but the plan
  last_chunk_committed,
  chunks_lost,  // found while assembling: bytes of finished chunks are gone
  result_committed,
  failed,  // a task failed for good
  cancelled,
  retried,
  answered_from_cache,  // at submission: an equal order succeeded earlier
};

struct JobPosition {
  JobState state = JobState::queued;
  JobStage stage = JobStage::plan;
  friend bool operator==(const JobPosition&, const JobPosition&) = default;
};

// Where `event` takes a job, or nothing when the event is not allowed there. A retried job returns
// to the stage in which it stopped, so that its plan and its finished chunks are kept.
std::optional<JobPosition> next_position(const JobPosition& position, JobEvent event);

// While running, a job cannot be removed: cancel it first.
bool can_remove(JobState state);

enum class TaskState { waiting, leased, done };

// What becomes of a task whose oven crashed for the `crashes`-th time (1 = the first).
enum class TaskVerdict { try_again, fail_job };
TaskVerdict after_crash(int crashes, int max_attempts);

// What becomes of a task whose lease was lost for the `losses`-th time. A lost lease says nothing
// about the input (its worker was killed or cut off), so it has a count of its own.
inline constexpr int kMaxLostLeases = 3;
TaskVerdict after_lost_lease(int losses);

}  // namespace lightkiln
