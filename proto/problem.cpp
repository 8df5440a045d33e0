#include "proto/problem.h"

#include <algorithm>

#include "proto/json_view.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

constexpr ProblemKind kKindsOfProblem[] = {
    {"invalid_spec", 422, "The order is not valid", false, ErrorCode::invalid_spec,
     "The order breaks the contract of its kind. Every fault stands in `errors` with its place; "
     "correct all of them and send the order again."},
    {"invalid_input", 422, "The input cannot be used", false, ErrorCode::invalid_input,
     "A file or a value that was sent is malformed or cannot be baked. The detail names the place; "
     "repair the file and upload it again."},
    {"unsupported", 422, "This is not supported", false, ErrorCode::unsupported,
     "The request is well formed but asks for something that the engine does not do. The detail "
     "names it."},
    {"too_large", 413, "This is too large", false, ErrorCode::too_large,
     "Something is over a stated limit. The detail gives the limit."},
    {"not_found", 404, "Nothing is here", false, ErrorCode::not_found,
     "There is no such path, job, artifact or blob, or not yet. Blobs must be uploaded before a "
     "job names them."},
    {"conflict", 409, "This conflicts with the present state", false, ErrorCode::conflict,
     "The resource is in a state that does not allow this, or an Idempotency-Key was used before "
     "for another request. Look at the resource and decide again."},
    {"cancelled", 409, "The job was cancelled", false, ErrorCode::cancelled,
     "The job was stopped on request. Retrying it keeps what is finished."},
    {"timed_out", 504, "This took too long", true, ErrorCode::timed_out,
     "A time limit was reached. Order less, or try again when the machine is less busy."},
    {"out_of_memory", 507, "This needs more memory than is granted", false,
     ErrorCode::out_of_memory,
     "The bake needs more memory than its operator grants. Use a smaller scene or smaller maps."},
    {"unauthorized", 401, "A token is needed", false, ErrorCode::unauthorized,
     "The request carries no valid token. Send `Authorization: Bearer <token>`."},
    {"forbidden", 403, "This is not allowed", false, ErrorCode::forbidden,
     "The request comes from a place, or is of a sort, that the daemon does not accept."},
    {"unavailable", 503, "Try again later", true, ErrorCode::unavailable,
     "The daemon cannot take this now: it is busy or stopping. Retry-After says when to ask "
     "again."},
    {"internal", 500, "The service made a mistake", false, ErrorCode::internal,
     "Something failed inside the service. The log has the details under the instance given."},
    // Raised by the store beside `unavailable`.
    {"storage_full", 507, "The disk is full", true, ErrorCode::unavailable,
     "The store's disk has no room for this. Its operator must make some, for example by deleting "
     "jobs; Retry-After says when to ask again."},
    {"queue_full", 429, "The queue is full", true, ErrorCode::unavailable,
     "As many jobs wait as the daemon takes. Retry-After says when to ask again."},
    // Raised by the HTTP layer alone.
    {"malformed_json", 400, "The body is not JSON", false, ErrorCode::invalid_spec,
     "The body must be one JSON text in UTF-8 with no key twice in an object."},
    {"bad_request", 400, "The request is malformed", false, ErrorCode::invalid_spec,
     "The request breaks a rule of HTTP or carries a header or a parameter that cannot be read. "
     "The detail names it."},
    {"method_not_allowed", 405, "The method is not allowed here", false, ErrorCode::invalid_spec,
     "The path exists but not with this method. The Allow header lists those that do."},
    {"request_timeout", 408, "The request came too slowly", true, ErrorCode::timed_out,
     "The whole request must arrive within the time limits of the daemon."},
    {"length_required", 411, "A length is needed", false, ErrorCode::invalid_spec,
     "A request with a body must give its Content-Length."},
    {"uri_too_long", 414, "The path is too long", false, ErrorCode::too_large,
     "The request line is over its limit."},
    {"unsupported_media_type", 415, "This media type is not accepted", false,
     ErrorCode::unsupported,
     "Send application/json to the API and application/octet-stream to blobs, without a content "
     "encoding."},
    {"range_not_satisfiable", 416, "The range is not satisfiable", false, ErrorCode::invalid_input,
     "The range lies beyond the end. Content-Range gives the size."},
    {"expectation_failed", 417, "The expectation cannot be met", false, ErrorCode::unsupported,
     "Of the header Expect only 100-continue is known."},
    {"misdirected", 421, "The host is not this one", false, ErrorCode::forbidden,
     "The Host header names a host that this daemon does not serve."},
    {"too_many_requests", 429, "Too many requests", true, ErrorCode::unavailable,
     "Too many attempts failed within a minute. Retry-After says when to ask again."},
    {"headers_too_large", 431, "The headers are too large", false, ErrorCode::too_large,
     "The request's headers are over the limit of bytes or lines."},
    {"version_not_supported", 505, "This version of HTTP is not supported", false,
     ErrorCode::unsupported, "Speak HTTP/1.1."},
};

}  // namespace

std::span<const ProblemKind> problem_kinds() {
  return kKindsOfProblem;
}

const ProblemKind* find_problem_kind(std::string_view code) {
  for (const ProblemKind& kind : kKindsOfProblem)
    if (code == kind.code) return &kind;
  return nullptr;
}

const ProblemKind& problem_kind(ErrorCode code) {
  const ProblemKind* kind = find_problem_kind(error_code_name(code));
  if (!kind)
    throw Error(ErrorCode::internal,
                std::string("No row describes the problem ") + error_code_name(code) + ".");
  return *kind;
}

Problem make_problem(std::string_view code, const std::string& detail,
                     const std::string& instance) {
  const ProblemKind* kind = find_problem_kind(code);
  if (!kind)
    throw Error(ErrorCode::internal, "No row describes the problem " + std::string(code) + ".");
  return {kind->code, kind->status, kind->title, detail, instance, kind->retryable, {}};
}

Problem problem_from_error(const Error& error, const std::string& instance) {
  const char* code = error_code_name(error.code());
  if (error.code() == ErrorCode::internal)
    return make_problem(code, "The service failed; its log says why.", instance);
  Problem problem = make_problem(code, error.what(), instance);
  if (!error.where().empty()) problem.errors.push_back({error.where(), code, error.what()});
  return problem;
}

Problem problem_from_faults(const std::vector<SpecFault>& faults, const std::string& instance) {
  const auto is = [](const char* code) {
    return [code](const SpecFault& fault) { return fault.code == code && fault.pointer.empty(); };
  };
  const bool syntax = std::any_of(faults.begin(), faults.end(), is("syntax"));
  const bool large = std::any_of(faults.begin(), faults.end(),
                                 [](const SpecFault& fault) { return fault.code == "too_large"; });
  const std::string detail = faults.size() == 1 ? faults[0].message
                                                : "The order has " + std::to_string(faults.size()) +
                                                      " faults; the first: " + faults.at(0).message;
  Problem problem = make_problem(syntax  ? "malformed_json"
                                 : large ? "too_large"
                                         : "invalid_spec",
                                 detail, instance);
  problem.errors = faults;
  return problem;
}

std::string write_problem(const Problem& problem) {
  JsonWriter writer;
  writer.begin_object()
      .member("type", "/problems/" + problem.code)
      .member("title", problem.title)
      .member("status", problem.status)
      .member("detail", problem.detail);
  if (!problem.instance.empty()) writer.member("instance", problem.instance);
  writer.member("code", problem.code).member("retryable", problem.retryable);
  if (!problem.errors.empty()) {
    writer.key("errors").begin_array();
    for (const SpecFault& fault : problem.errors) {
      writer.begin_object()
          .member("pointer", fault.pointer)
          .member("code", fault.code)
          .member("detail", fault.message);
      if (!fault.allowed.empty()) writer.member("allowed", fault.allowed);
      if (!fault.suggestion.empty()) writer.member("suggestion", fault.suggestion);
      writer.end_object();
    }
    writer.end_array();
  }
  writer.end_object();
  return writer.take();
}

Problem read_problem(std::string_view json) {
  const std::string what = "The server's problem document";
  const JsonValue value = read_trusted_json(json, ErrorCode::unavailable, what);
  const JsonView view(value, ErrorCode::unavailable, what);
  Problem problem;
  problem.code = view.text("code");
  problem.status = view.integer("status");
  problem.title = view.text("title");
  problem.detail = view.text("detail");
  problem.retryable = view.boolean("retryable");
  if (view.has("instance")) problem.instance = view.text("instance");
  if (!view.has("errors")) return problem;
  for (const JsonValue& item : view.at("errors").items()) {
    const JsonView fault = view.view(item);
    problem.errors.push_back({fault.text("pointer"), fault.text("code"), fault.text("detail"),
                              fault.has("allowed") ? fault.text("allowed") : "",
                              fault.has("suggestion") ? fault.text("suggestion") : ""});
  }
  return problem;
}

}  // namespace lightkiln
