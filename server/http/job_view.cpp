#include "server/http/job_view.h"

#include <algorithm>
#include <charconv>

namespace lightkiln {

namespace {

const std::string kJobTag = std::string("\"job-") + LIGHTKILN_VERSION + '-';

}  // namespace

double job_fraction(const JobRecord& job) {
  if (job.state == JobState::succeeded) return 1;
  if (job.chunks_total == 0) return 0;
  const double done = static_cast<double>(job.chunks_done) + std::clamp(job.chunk_fraction, 0., 1.);
  return std::min(1., done / static_cast<double>(job.chunks_total));
}

std::string error_unit(const std::string& kind) {
  if (kind == kind_name(Kind::ambient_occlusion)) return "95 % half-width of openness, absolute";
  if (kind == kind_name(Kind::probes))
    return "95 % bound on the cube's error, relative to the job's mean luminance";
  return "bound, relative to the map's mean luminance";
}

ArtifactMessage artifact_message(const ArtifactRecord& artifact) {
  return {artifact.name, artifact.role, artifact.media_type, artifact.bytes, artifact.digest};
}

EventMessage event_message(const EventRecord& event) {
  return {event.sequence, event.job_id, event.type, event.time_ms, event.json};
}

JobMessage listed_job_message(const JobRecord& job) {
  JobMessage message;
  message.id = job.id;
  message.name = job.name;
  message.kind = job.kind;
  message.plan_only = job.plan_only;
  message.state = job_state_name(job.state);
  message.terminal = is_terminal(job.state);
  message.stage = job_stage_name(job.stage);
  message.reason = job.reason;
  message.spec_digest = job.spec_digest;
  message.labels = job.labels;
  message.priority = job.priority;
  message.progress.done = job.chunks_done;
  message.progress.total = job.chunks_total;
  message.progress.fraction = job_fraction(job);
  if (job.state == JobState::running && job.chunks_total > 0)
    message.progress.eta_s = job.predicted_s * (1 - message.progress.fraction);
  if (job.current_error > 0) message.quality.error = job.current_error;
  message.quality.target = job.target_error;
  message.quality.unit = error_unit(job.kind);
  message.predicted_s = job.predicted_s;
  message.from_cache = job.from_cache;
  message.attempts = job.attempts;
  if (job.error)
    message.error = JobErrorMessage{job.error->code, job.error->detail, job.error->pointer};
  message.created_ms = job.created_ms;
  message.started_ms = job.started_ms;
  message.finished_ms = job.finished_ms;
  return message;
}

JobMessage job_message(const JobRecord& job, const std::vector<ArtifactRecord>& artifacts) {
  JobMessage message = listed_job_message(job);
  message.spec_json = job.spec_json;
  for (const ArtifactRecord& artifact : artifacts)
    message.artifacts.push_back(artifact_message(artifact));
  message.plan_json = job.plan_json;
  return message;
}

std::string job_etag(const JobRecord& job) {
  return kJobTag + std::to_string(job.version) + '"';
}

std::string list_etag(uint64_t list_version) {
  return std::string("\"list-") + LIGHTKILN_VERSION + '-' + std::to_string(list_version) + '"';
}

uint64_t version_of_etag(const std::string& etag) {
  uint64_t version = 0;
  if (!etag.starts_with(kJobTag) || etag.size() <= kJobTag.size() + 1) return 0;
  const char* end = etag.data() + etag.size() - 1;
  const auto result = std::from_chars(etag.data() + kJobTag.size(), end, version);
  return result.ec == std::errc() && result.ptr == end ? version : 0;
}

}  // namespace lightkiln
