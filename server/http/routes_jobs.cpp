// Orders: submit, check, list, show, cancel, retry, forget, and what is known about their progress.

#include <algorithm>

#include "proto/messages.h"
#include "server/http/job_view.h"
#include "server/http/problems.h"
#include "server/http/ranges.h"
#include "server/http/routes.h"

namespace lightkiln {

namespace {

constexpr uint64_t kUntilTerminal = UINT64_MAX;
// Records held at a time while a page is made.
constexpr int kRecordsAtATime = 64;
// A page ends after the job that brings it here.
constexpr size_t kPageBytes = 1 << 20;

std::string show(Store& store, const JobRecord& job) {
  const bool made = job.state == JobState::succeeded;
  return write_job(
      job_message(job, made ? store.artifacts(job.id) : std::vector<ArtifactRecord>()));
}

// One fault for every input that was not uploaded, where the spec names it.
std::vector<SpecFault> missing_inputs(Store& store, const Spec& spec) {
  std::vector<SpecFault> faults;
  const auto check = [&](const std::string& digest, const std::string& pointer) {
    if (!store.has_blob(digest))
      faults.push_back({pointer, "missing", "The blob " + digest + " was not uploaded."});
  };
  const auto check_input = [&](const std::optional<InputRef>& input, const std::string& pointer) {
    if (!input) return;
    for (size_t i = 0; i < input->faces.size(); ++i)
      check(input->faces[i], pointer + "/faces/" + kCubeFaceNames.at(i));
    if (!input->faces.empty()) return;
    check(input->blob, input->resources.empty() ? pointer : pointer + "/blob");
    for (const auto& [uri, digest] : input->resources) {
      std::string escaped;  // RFC 6901, section 3
      for (const char c : uri) escaped += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
      check(digest, pointer + "/resources/" + escaped);
    }
  };
  check_input(spec.scene, "/spec/inputs/scene");
  check_input(spec.environment, "/spec/inputs/environment");
  return faults;
}

std::string idempotency_key(const HttpHead& head) {
  const std::string* key = head.header("idempotency-key");
  if (!key) return "";
  if (key->empty() || key->size() > kMaxIdempotencyKeyBytes)
    throw HttpRefusal{400, "Idempotency-Key must be 1 to 64 bytes long."};
  return *key;
}

HttpReply accept_job(RouteContext& context, RouteCall& call, bool plan_only) {
  const HttpHead& head = call.request.head;
  const ParsedJobRequest parsed = parse_job_request(call.request.body);
  if (!parsed.faults.empty()) return faults_reply(parsed.faults, head.request_id);
  const JobRequest& order = parsed.request;
  Submission submission;
  submission.idempotency_key = idempotency_key(head);
  const auto missing = missing_inputs(context.store, order.spec);
  if (!missing.empty()) return faults_reply(missing, head.request_id);
  submission.name = order.name;
  submission.kind = kind_name(order.spec.kind());
  submission.spec_json = order.canonical;
  submission.spec_digest = order.spec_digest;
  submission.labels = order.labels;
  submission.inputs = input_digests(order.spec);
  submission.priority = order.priority;
  submission.plan_only = plan_only;
  submission.target_error = target_error(order.spec);
  const std::string identity = (plan_only ? "plan\n" : "job\n") + call.request.body;
  submission.request_digest = sha256_digest(identity.data(), identity.size());
  const SubmitResult result = context.store.submit(submission);

  JobRecord job = need_job(context.store, result.job_id);
  const int wait_s = preferred_wait_s(head);
  const bool waited = wait_s > 0 && wait_for_job(context, job, kUntilTerminal, wait_s);
  HttpReply reply = json_reply(show(context.store, job), 202);
  reply.set("Location", job_href(job.id)).set("ETag", job_etag(job));
  if (!is_terminal(job.state)) reply.set("Retry-After", "1");
  if (waited) reply.set("Preference-Applied", "wait=" + std::to_string(wait_s));
  if (result.replayed) reply.set("Idempotency-Replayed", "true");
  return reply;
}

HttpReply submit_job(RouteContext& context, RouteCall& call) {
  return accept_job(context, call, false);
}
HttpReply submit_plan(RouteContext& context, RouteCall& call) {
  return accept_job(context, call, true);
}

HttpReply validate_job(RouteContext& context, RouteCall& call) {
  const ParsedJobRequest parsed = parse_job_request(call.request.body);
  if (!parsed.faults.empty()) return faults_reply(parsed.faults, call.request.head.request_id);
  ValidationMessage message{parsed.request.canonical, parsed.request.spec_digest, {}};
  message.missing_blobs = context.store.missing_blobs(input_digests(parsed.request.spec));
  return json_reply(write_validation(message));
}

JobState parse_state(const std::string& text) {
  std::string allowed;
  for (const JobState state : {JobState::queued, JobState::running, JobState::succeeded,
                               JobState::failed, JobState::cancelled}) {
    if (text == job_state_name(state)) return state;
    allowed += std::string(allowed.empty() ? "" : ", ") + job_state_name(state);
  }
  throw HttpRefusal{400, "The query parameter 'state' must be one of: " + allowed + "."};
}

JobFilter parse_filter(const HttpHead& head) {
  JobFilter filter;
  filter.limit = static_cast<int>(integer_parameter(head, "limit", 50, 1, kMaxPageSize));
  if (const std::string* state = head.parameter("state")) filter.state = parse_state(*state);
  if (const std::string* kind = head.parameter("kind")) {
    const bool known = std::any_of(std::begin(kKinds), std::end(kKinds),
                                   [&](Kind one) { return *kind == kind_name(one); });
    if (!known) throw HttpRefusal{400, "The query parameter 'kind' names no kind; see /v1/kinds."};
    filter.kind = *kind;
  }
  if (const std::string* text = head.parameter("text")) filter.text = *text;
  if (const std::string* after = head.parameter("after")) filter.after = *after;
  if (const std::string* label = head.parameter("label")) {
    const size_t colon = label->find(':');
    if (colon == std::string::npos)
      throw HttpRefusal{400, "The query parameter 'label' must read key:value."};
    filter.label = {label->substr(0, colon), label->substr(colon + 1)};
  }
  return filter;
}

std::string escape_query(const std::string& text) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string result;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '~';
    if (plain) {
      result += c;
    } else {
      result += '%';
      result += kHex[byte >> 4];
      result += kHex[byte & 15];
    }
  }
  return result;
}

JobPage make_page(Store& store, JobFilter filter) {
  const auto most = static_cast<size_t>(filter.limit);
  filter.limit = kRecordsAtATime;
  JobPage page;
  for (size_t bytes = 0;;) {
    const std::vector<JobRecord> records = store.list_jobs(filter);
    for (const JobRecord& record : records) {
      if (page.items.size() == most || bytes >= kPageBytes) {
        page.next = page.items.back().id;
        return page;
      }
      page.items.push_back(listed_job_message(record));
      bytes += write_job(page.items.back()).size();
    }
    if (records.size() < kRecordsAtATime) return page;
    filter.after = records.back().id;
  }
}

HttpReply list_jobs(RouteContext& context, RouteCall& call) {
  const HttpHead& head = call.request.head;
  const JobFilter filter = parse_filter(head);
  // The version is read first: a change in between is then seen by the next conditional request.
  const std::string etag = list_etag(context.store.list_version());
  if (none_match_hits(head, etag)) return not_modified(etag);
  const JobPage page = make_page(context.store, filter);
  HttpReply reply = tagged_reply(head, write_job_page(page), etag);
  if (!page.next.empty()) {
    std::string link = std::string(kApiPrefix) + "/jobs?";
    for (const auto& [name, value] : head.query)
      if (name != "after") link += name + '=' + escape_query(value) + '&';
    reply.set("Link", '<' + link + "after=" + page.next + ">; rel=\"next\"");
  }
  return reply;
}

HttpReply show_job(RouteContext& context, RouteCall& call) {
  const HttpHead& head = call.request.head;
  JobRecord job = need_job(context.store, call.values[0]);
  const int wait_s = preferred_wait_s(head);
  bool waited = false;
  if (wait_s > 0) {
    const std::string* known = head.header("if-none-match");
    const uint64_t version = known ? version_of_etag(*known) : kUntilTerminal;
    waited = wait_for_job(context, job, version, wait_s);
  }
  const std::string etag = job_etag(job);
  HttpReply reply = none_match_hits(head, etag)
                        ? not_modified(etag)
                        : tagged_reply(head, show(context.store, job), etag);
  if (waited) reply.set("Preference-Applied", "wait=" + std::to_string(wait_s));
  return reply;
}

HttpReply answer_with_job(RouteContext& context, const std::string& id) {
  const JobRecord job = need_job(context.store, id);
  return json_reply(show(context.store, job)).set("ETag", job_etag(job));
}

HttpReply cancel_job(RouteContext& context, RouteCall& call) {
  context.store.cancel(call.values[0]);
  return answer_with_job(context, call.values[0]);
}

HttpReply retry_job(RouteContext& context, RouteCall& call) {
  context.store.retry(call.values[0]);
  return answer_with_job(context, call.values[0]);
}

HttpReply delete_job(RouteContext& context, RouteCall& call) {
  context.store.remove(call.values[0]);
  HttpReply reply;
  reply.status = 204;
  return reply;
}

HttpReply show_plan(RouteContext& context, RouteCall& call) {
  const JobRecord job = need_job(context.store, call.values[0]);
  if (job.plan_json.empty()) throw Error(ErrorCode::not_found, "The job is not planned yet.");
  return tagged_reply(call.request.head, job.plan_json, job_etag(job));
}

HttpReply show_accuracy(RouteContext& context, RouteCall& call) {
  const JobRecord job = need_job(context.store, call.values[0]);
  if (job.accuracy_json.empty())
    throw Error(ErrorCode::not_found, "The job has no accuracy record: it is not finished.");
  return tagged_reply(call.request.head, job.accuracy_json, job_etag(job));
}

HttpReply show_convergence(RouteContext& context, RouteCall& call) {
  const JobRecord job = need_job(context.store, call.values[0]);
  const std::string etag = job_etag(job);
  if (none_match_hits(call.request.head, etag)) return not_modified(etag);
  std::vector<ChunkReport> reports;
  for (const std::string& json : context.store.chunk_reports(job.id))
    reports.push_back(read_chunk_report(json));
  const AccuracyRecord record =
      summarise_accuracy(reports, job.target_error, job.predicted_s, error_unit(job.kind));
  return tagged_reply(call.request.head, write_convergence(record), etag);
}

HttpReply list_events(RouteContext& context, RouteCall& call) {
  const HttpHead& head = call.request.head;
  const auto after = static_cast<uint64_t>(integer_parameter(head, "after", 0, 0, INT64_MAX));
  const auto limit = static_cast<int>(integer_parameter(head, "limit", 100, 1, kMaxPageSize));
  const JobRecord job = need_job(context.store, call.values[0]);
  std::vector<EventMessage> events;
  for (const EventRecord& event : context.store.events(job.id, after, limit))
    events.push_back(event_message(event));
  return json_reply(write_event_page(events, after));
}

}  // namespace

std::vector<Route> job_routes() {
  using enum Scope;
  const BodyRule none = BodyRule::none, buffered = BodyRule::buffered;
  return {
      {"POST", "/v1/jobs", submit, buffered, {}, submit_job},
      {"GET",
       "/v1/jobs",
       read,
       none,
       {"state", "kind", "text", "label", "limit", "after"},
       list_jobs},
      {"POST", "/v1/jobs:validate", submit, buffered, {}, validate_job},
      {"POST", "/v1/plans", submit, buffered, {}, submit_plan},
      {"GET", "/v1/jobs/{id}", read, none, {}, show_job},
      {"DELETE", "/v1/jobs/{id}", cancel, none, {}, delete_job},
      {"POST", "/v1/jobs/{id}:cancel", cancel, none, {}, cancel_job},
      {"POST", "/v1/jobs/{id}:retry", cancel, none, {}, retry_job},
      {"GET", "/v1/jobs/{id}/plan", read, none, {}, show_plan},
      {"GET", "/v1/jobs/{id}/accuracy", read, none, {}, show_accuracy},
      {"GET", "/v1/jobs/{id}/convergence", read, none, {}, show_convergence},
      {"GET", "/v1/jobs/{id}/events", read, none, {"after", "limit"}, list_events},
  };
}

}  // namespace lightkiln
