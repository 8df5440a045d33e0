#include "server/http/problems.h"

#include "server/store/refusal.h"

namespace lightkiln {

namespace {

std::string instance_of(const std::string& request_id) {
  return "urn:request:" + request_id;
}

// How soon trying again can help: places in a queue come free as jobs end, room on a disk when an
// operator makes some.
const char* retry_after_s(const Problem& problem) {
  if (problem.code == kQueueFull) return "10";
  return problem.status == 429 || problem.status == 507 ? "60" : "2";
}

}  // namespace

const char* http_problem_code(int status) {
  switch (status) {
    case 400:
      return "bad_request";
    case 401:
      return "unauthorized";
    case 403:
      return "forbidden";
    case 404:
      return "not_found";
    case 405:
      return "method_not_allowed";
    case 408:
      return "request_timeout";
    case 411:
      return "length_required";
    case 413:
      return "too_large";
    case 414:
      return "uri_too_long";
    case 415:
      return "unsupported_media_type";
    case 416:
      return "range_not_satisfiable";
    case 417:
      return "expectation_failed";
    case 421:
      return "misdirected";
    case 429:
      return "too_many_requests";
    case 431:
      return "headers_too_large";
    case 503:
      return "unavailable";
    case 505:
      return "version_not_supported";
    default:
      return "internal";
  }
}

HttpReply problem_reply(const Problem& problem) {
  HttpReply reply;
  reply.status = problem.status;
  reply.media_type = kProblemMediaType;
  reply.body = write_problem(problem);
  reply.set("Cache-Control", "no-store");
  if (problem.retryable) reply.set("Retry-After", retry_after_s(problem));
  return reply;
}

HttpReply error_reply(const Error& error, const std::string& request_id) {
  if (const auto* refusal = dynamic_cast<const StoreRefusal*>(&error))
    return problem_reply(
        make_problem(refusal->problem_code(), refusal->what(), instance_of(request_id)));
  return problem_reply(problem_from_error(error, instance_of(request_id)));
}

HttpReply status_reply(int status, const std::string& detail, const std::string& request_id) {
  Problem problem = make_problem(http_problem_code(status), detail, instance_of(request_id));
  if (detail.empty()) problem.detail = find_problem_kind(problem.code)->meaning;
  return problem_reply(problem);
}

HttpReply faults_reply(const std::vector<SpecFault>& faults, const std::string& request_id) {
  return problem_reply(problem_from_faults(faults, instance_of(request_id)));
}

}  // namespace lightkiln
