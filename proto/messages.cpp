// Answers of the daemon: written there, read by clients.

#include "proto/messages.h"

#include "proto/accuracy_json.h"
#include "proto/json_view.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

// A server's answer with its text, so that views into it stay valid.
struct Answer {
  JsonValue value;
  std::string what;

  Answer(std::string_view json, const char* name)
      : value(read_trusted_json(json, ErrorCode::unavailable, name)), what(name) {}
  JsonView view() const { return JsonView(value, ErrorCode::unavailable, what); }
};

std::string text_of(const JsonValue& value) {
  JsonWriter writer;
  writer.value(value);
  return writer.take();
}

void write_time(JsonWriter& writer, std::string_view key, int64_t unix_ms) {
  writer.key(key);
  if (unix_ms == 0)
    writer.null();
  else
    writer.value(format_time(unix_ms));
}

int64_t read_time(const JsonView& view) {
  return view.is_null() ? 0 : parse_time(view.text());
}

void write_optional(JsonWriter& writer, std::string_view key, const std::optional<double>& number) {
  writer.key(key);
  if (number)
    writer.value(*number);
  else
    writer.null();
}

std::optional<double> read_optional(const JsonView& view) {
  if (view.is_null()) return std::nullopt;
  return view.number();
}

void write_artifacts(JsonWriter& writer, const std::string& job_id,
                     const std::vector<ArtifactMessage>& artifacts) {
  writer.begin_array();
  for (const ArtifactMessage& artifact : artifacts)
    writer.begin_object()
        .member("name", artifact.name)
        .member("role", artifact.role)
        .member("media_type", artifact.media_type)
        .member("bytes", artifact.bytes)
        .member("digest", artifact.digest)
        .member("href", artifact_href(job_id, artifact.name))
        .end_object();
  writer.end_array();
}

std::vector<ArtifactMessage> read_artifacts(const JsonView& list) {
  std::vector<ArtifactMessage> artifacts;
  for (const JsonValue& item : list.items()) {
    const JsonView view = list.view(item);
    artifacts.push_back({view.text("name"), view.text("role"), view.text("media_type"),
                         view.count("bytes"), view.text("digest")});
  }
  return artifacts;
}

void write_links(JsonWriter& writer, const std::string& id) {
  const std::string self = job_href(id);
  writer.begin_object().member("self", self);
  for (const char* part : {"plan", "accuracy", "convergence", "events", "artifacts"})
    writer.member(part, self + "/" + part);
  writer.member("cancel", self + ":cancel").member("retry", self + ":retry").end_object();
}

void write_job_into(JsonWriter& writer, const JobMessage& job) {
  writer.begin_object()
      .member("id", job.id)
      .member("name", job.name)
      .member("kind", job.kind)
      .member("plan_only", job.plan_only)
      .member("state", job.state)
      .member("terminal", job.terminal)
      .member("stage", job.stage)
      .member("reason", job.reason);
  if (!job.spec_json.empty()) writer.key("spec").raw(job.spec_json);
  writer.member("spec_digest", job.spec_digest).key("labels").begin_object();
  for (const auto& [key, value] : job.labels) writer.member(key, value);
  writer.end_object().member("priority", job.priority).key("progress").begin_object();
  writer.member("done", job.progress.done)
      .member("total", job.progress.total)
      .member("unit", job.progress.unit)
      .member("fraction", job.progress.fraction);
  write_optional(writer, "eta_s", job.progress.eta_s);
  writer.end_object().key("quality").begin_object();
  write_optional(writer, "error", job.quality.error);
  writer.member("target", job.quality.target).member("unit", job.quality.unit).end_object();
  writer.member("predicted_s", job.predicted_s)
      .member("from_cache", job.from_cache)
      .member("attempts", job.attempts)
      .key("error");
  if (job.error)
    writer.begin_object()
        .member("code", job.error->code)
        .member("detail", job.error->detail)
        .member("pointer", job.error->pointer)
        .end_object();
  else
    writer.null();
  write_time(writer, "created_at", job.created_ms);
  write_time(writer, "started_at", job.started_ms);
  write_time(writer, "finished_at", job.finished_ms);
  writer.key("artifacts");
  write_artifacts(writer, job.id, job.artifacts);
  writer.key("links");
  write_links(writer, job.id);
  if (!job.plan_json.empty()) writer.key("plan").raw(job.plan_json);
  writer.end_object();
}

JobMessage read_job_from(const JsonView& view) {
  JobMessage job;
  job.id = view.text("id");
  job.name = view.text("name");
  job.kind = view.text("kind");
  job.plan_only = view.boolean("plan_only");
  job.state = view.text("state");
  job.terminal = view.boolean("terminal");
  job.stage = view.text("stage");
  job.reason = view.text("reason");
  if (view.has("spec")) job.spec_json = text_of(view.at("spec").json());
  job.spec_digest = view.text("spec_digest");
  for (const JsonMember& label : view.at("labels").members())
    job.labels[label.key] = view.view(label.value).text();
  job.priority = view.integer("priority");
  const JsonView progress = view.at("progress");
  job.progress = {progress.count("done"), progress.count("total"), progress.text("unit"),
                  progress.number("fraction"), read_optional(progress.at("eta_s"))};
  const JsonView quality = view.at("quality");
  job.quality = {read_optional(quality.at("error")), quality.number("target"),
                 quality.text("unit")};
  job.predicted_s = view.number("predicted_s");
  job.from_cache = view.boolean("from_cache");
  job.attempts = view.integer("attempts");
  const JsonView error = view.at("error");
  if (!error.is_null())
    job.error = JobErrorMessage{error.text("code"), error.text("detail"), error.text("pointer")};
  job.created_ms = read_time(view.at("created_at"));
  job.started_ms = read_time(view.at("started_at"));
  job.finished_ms = read_time(view.at("finished_at"));
  job.artifacts = read_artifacts(view.at("artifacts"));
  if (view.has("plan")) job.plan_json = text_of(view.at("plan").json());
  return job;
}

std::vector<std::string> read_texts(const JsonView& list) {
  std::vector<std::string> texts;
  for (const JsonValue& item : list.items()) texts.push_back(list.view(item).text());
  return texts;
}

}  // namespace

std::string write_job(const JobMessage& job) {
  JsonWriter writer;
  write_job_into(writer, job);
  return writer.take();
}

JobMessage read_job(std::string_view json) {
  const Answer answer(json, "The server's job");
  return read_job_from(answer.view());
}

std::string write_job_page(const JobPage& page) {
  JsonWriter writer;
  writer.begin_object().key("items").begin_array();
  for (const JobMessage& job : page.items) write_job_into(writer, job);
  writer.end_array().key("next");
  if (page.next.empty())
    writer.null();
  else
    writer.value(page.next);
  writer.end_object();
  return writer.take();
}

JobPage read_job_page(std::string_view json) {
  const Answer answer(json, "The server's list of jobs");
  const JsonView view = answer.view();
  JobPage page;
  for (const JsonValue& item : view.at("items").items())
    page.items.push_back(read_job_from(view.view(item)));
  if (!view.at("next").is_null()) page.next = view.text("next");
  return page;
}

std::string write_validation(const ValidationMessage& message) {
  JsonWriter writer;
  writer.begin_object()
      .member("valid", true)
      .key("spec")
      .raw(message.spec_json)
      .member("spec_digest", message.spec_digest)
      .member("missing_blobs", message.missing_blobs)
      .end_object();
  return writer.take();
}

ValidationMessage read_validation(std::string_view json) {
  const Answer answer(json, "The server's validation");
  const JsonView view = answer.view();
  return {text_of(view.at("spec").json()), view.text("spec_digest"),
          read_texts(view.at("missing_blobs"))};
}

std::string write_artifact_list(const std::string& job_id,
                                const std::vector<ArtifactMessage>& artifacts) {
  JsonWriter writer;
  writer.begin_object().key("items");
  write_artifacts(writer, job_id, artifacts);
  writer.end_object();
  return writer.take();
}

std::vector<ArtifactMessage> read_artifact_list(std::string_view json) {
  const Answer answer(json, "The server's list of artifacts");
  return read_artifacts(answer.view().at("items"));
}

std::string write_event_page(const std::vector<EventMessage>& events, uint64_t after) {
  JsonWriter writer;
  writer.begin_object().key("items").begin_array();
  for (const EventMessage& event : events) {
    writer.begin_object()
        .member("sequence", event.sequence)
        .member("job_id", event.job_id)
        .member("type", event.type)
        .member("time", format_time(event.time_ms))
        .key("data")
        .raw(event.data_json)
        .end_object();
    after = event.sequence;
  }
  writer.end_array().member("next_after", after).end_object();
  return writer.take();
}

EventPage read_event_page(std::string_view json) {
  const Answer answer(json, "The server's list of events");
  const JsonView view = answer.view();
  EventPage page;
  page.next_after = view.count("next_after");
  for (const JsonValue& item : view.at("items").items()) {
    const JsonView event = view.view(item);
    page.items.push_back({event.count("sequence"), event.text("job_id"), event.text("type"),
                          parse_time(event.text("time")), text_of(event.at("data").json())});
  }
  return page;
}

std::string write_convergence(const AccuracyRecord& record) {
  JsonWriter writer;
  writer.begin_object()
      .member("target_error", record.target_error)
      .member("unit", record.error_unit)
      .member("elements", record.elements)
      .key("rounds");
  write_rounds(writer, record.rounds, record.elements);
  writer.key("time_to_error");
  write_prices(writer, record.time_to_error);
  writer.end_object();
  return writer.take();
}

std::string write_missing(const std::vector<std::string>& digests) {
  JsonWriter writer;
  writer.begin_object().member("missing", digests).end_object();
  return writer.take();
}

std::vector<std::string> read_missing(std::string_view json) {
  const Answer answer(json, "The server's list of missing blobs");
  return read_texts(answer.view().at("missing"));
}

std::string write_workers(const std::vector<WorkerMessage>& workers) {
  JsonWriter writer;
  writer.begin_object().key("items").begin_array();
  for (const WorkerMessage& worker : workers)
    writer.begin_object()
        .member("name", worker.name)
        .member("missing_sandbox_layers", worker.missing_sandbox_layers)
        .end_object();
  writer.end_array().end_object();
  return writer.take();
}

std::vector<WorkerMessage> read_workers(std::string_view json) {
  const Answer answer(json, "The server's list of workers");
  std::vector<WorkerMessage> workers;
  for (const JsonValue& item : answer.view().at("items").items()) {
    const JsonView view = answer.view().view(item);
    workers.push_back({view.text("name"), read_texts(view.at("missing_sandbox_layers"))});
  }
  return workers;
}

std::string write_version(const VersionMessage& message) {
  JsonWriter writer;
  writer.begin_object()
      .member("name", message.name)
      .member("version", message.version)
      .member("engine_version", message.engine_version)
      .member("api", message.api)
      .end_object();
  return writer.take();
}

VersionMessage read_version(std::string_view json) {
  const Answer answer(json, "The server's version");
  const JsonView view = answer.view();
  return {view.text("name"), view.text("version"), view.text("engine_version"), view.text("api")};
}

}  // namespace lightkiln
