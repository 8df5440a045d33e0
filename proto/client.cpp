#include "proto/client.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <random>
#include <thread>

#include "proto/client_transport.h"
#include "proto/digest.h"
#include "proto/download.h"

namespace lightkiln {

struct Client::Call {
  HttpRequest request;
  int good = 200;       // a status that is an answer
  int also_good = 200;  // another one
};
struct Client::Answer : HttpResponse {};

namespace {

constexpr double kLongestPause = 8;
constexpr double kLongestRetryAfter = 30;

bool worth_another_try(int status) {
  return status == 429 || status == 502 || status == 503 || status == 504;
}

double retry_after(const HttpResponse& response) {
  const auto found = response.headers.find("retry-after");
  if (found == response.headers.end()) return 0;
  int seconds = 0;
  const std::string& text = found->second;
  std::from_chars(text.data(), text.data() + text.size(), seconds);
  return std::clamp<double>(seconds, 0, kLongestRetryAfter);
}

// A refusal without a problem document of ours comes from something between us and the daemon.
Problem problem_of(const HttpResponse& response) {
  const auto type = response.headers.find("content-type");
  if (type != response.headers.end() && type->second.starts_with(kProblemMediaType))
    return read_problem(response.body);
  Problem problem;
  problem.status = response.status;
  problem.retryable = worth_another_try(response.status);
  problem.detail = "The server answered " + std::to_string(response.status) +
                   " without saying why; is it a Lightkiln daemon?";
  for (const ProblemKind& kind : problem_kinds()) {
    if (kind.status != response.status) continue;
    problem.code = kind.code;
    problem.title = kind.title;
    break;
  }
  return problem;
}

ErrorCode error_of(const Problem& problem) {
  const ProblemKind* kind = find_problem_kind(problem.code);
  return kind ? kind->error : ErrorCode::internal;
}

std::string query_text(const JobQuery& query) {
  std::string text = "?limit=" + std::to_string(query.limit);
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) text += std::string("&") + name + "=" + percent_encode(value);
  };
  add("state", query.state);
  add("kind", query.kind);
  add("text", query.text);
  add("label", query.label);
  add("after", query.after);
  return text;
}

}  // namespace

ServerProblem::ServerProblem(const Problem& problem)
    : Error(error_of(problem), problem.detail), problem_(problem) {}

Client::Client(ClientOptions options) : options_(std::move(options)) {
  options_.server = parse_endpoint(options_.server).url;
}

Client::Answer Client::call_once(const Call& call) {
  HttpRequest request = call.request;
  request.headers.emplace_back("User-Agent", std::string("kiln/") + LIGHTKILN_VERSION);
  request.headers.emplace_back("Accept", "application/json, application/problem+json, */*");
  if (!options_.token.empty())
    request.headers.emplace_back("Authorization", "Bearer " + options_.token);
  request.read_timeout_s += options_.read_timeout_s;
  request.cancelled = options_.interrupted;
  return {exchange(parse_endpoint(options_.server), request)};
}

// False when the client was interrupted meanwhile.
bool Client::pause(int tried, double at_least_s) {
  static thread_local std::mt19937 random{std::random_device{}()};
  const double grown = std::min(
      options_.first_pause_s * static_cast<double>(1u << std::min(tried, 10)), kLongestPause);
  const double seconds =
      std::max(at_least_s, grown * std::uniform_real_distribution<double>(1.0, 1.25)(random));
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    if (options_.interrupted && options_.interrupted()) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

Client::Answer Client::call(const Call& call) {
  for (int tried = 0;; ++tried) {
    double at_least_s = 0;
    try {
      Answer answer = call_once(call);
      if (answer.status == call.good || answer.status == call.also_good) return answer;
      if (!worth_another_try(answer.status) || tried >= options_.retries)
        throw ServerProblem(problem_of(answer));
      at_least_s = retry_after(answer);
    } catch (const ServerProblem&) {
      throw;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::unavailable || tried >= options_.retries) throw;
    }
    if (!pause(tried, at_least_s))
      throw Error(ErrorCode::cancelled, "The request was interrupted.");
  }
}

VersionMessage Client::version() {
  Call request;
  request.request.path = "/version";
  const VersionMessage version = read_version(call(request).body);
  if (version.name != "lightkiln" || version.api != "v1")
    throw Error(ErrorCode::unavailable, options_.server + " speaks " + version.name + " " +
                                            version.api + "; this client speaks lightkiln v1.");
  return version;
}

ValidationMessage Client::validate(const std::string& request_json) {
  Call request;
  request.request.method = "POST";
  request.request.path = "/v1/jobs:validate";
  request.request.body = request_json;
  request.request.content_type = "application/json";
  return read_validation(call(request).body);
}

std::vector<WorkerMessage> Client::workers() {
  Call request;
  request.request.path = "/v1/workers";
  return read_workers(call(request).body);
}

std::vector<std::string> Client::missing_blobs(const std::vector<std::string>& digests) {
  std::vector<std::string> missing;
  for (size_t first = 0; first < digests.size(); first += kMaxDigestsPerRequest) {
    const size_t last = std::min(first + kMaxDigestsPerRequest, digests.size());
    Call request;
    request.request.method = "POST";
    request.request.path = "/v1/blobs:missing";
    request.request.body = write_digests({digests.begin() + static_cast<std::ptrdiff_t>(first),
                                          digests.begin() + static_cast<std::ptrdiff_t>(last)});
    request.request.content_type = "application/json";
    for (std::string& digest : read_missing(call(request).body))
      missing.push_back(std::move(digest));
  }
  return missing;
}

bool Client::upload(const std::string& digest, const std::filesystem::path& file, uint64_t bytes) {
  Call request;
  request.request.method = "PUT";
  request.request.path = "/v1/blobs/" + digest;
  request.request.content_type = "application/octet-stream";
  request.request.file = file;
  request.request.file_bytes = bytes;
  request.also_good = 201;
  return call(request).status == 201;
}

SubmitAnswer Client::post_job(const std::string& path, const std::string& request_json,
                              const std::string& idempotency_key, int wait_s) {
  Call request;
  request.request.method = "POST";
  request.request.path = path;
  request.request.body = request_json;
  request.request.content_type = "application/json";
  request.request.headers.emplace_back("Idempotency-Key", idempotency_key);
  if (wait_s > 0) request.request.headers.emplace_back("Prefer", "wait=" + std::to_string(wait_s));
  request.request.read_timeout_s = wait_s;
  request.good = 202;
  const Answer answer = call(request);
  const auto replayed = answer.headers.find("idempotency-replayed");
  return {read_job(answer.body), replayed != answer.headers.end() && replayed->second == "true"};
}

SubmitAnswer Client::submit(const std::string& request_json, const std::string& idempotency_key,
                            int wait_s) {
  return post_job("/v1/jobs", request_json, idempotency_key, wait_s);
}

SubmitAnswer Client::submit_plan(const std::string& request_json,
                                 const std::string& idempotency_key, int wait_s) {
  return post_job("/v1/plans", request_json, idempotency_key, wait_s);
}

JobMessage Client::job(const std::string& id, int wait_s) {
  Call request;
  request.request.path = job_href(id);
  if (wait_s > 0) request.request.headers.emplace_back("Prefer", "wait=" + std::to_string(wait_s));
  request.request.read_timeout_s = wait_s;
  return read_job(call(request).body);
}

JobPage Client::list(const JobQuery& query) {
  Call request;
  request.request.path = "/v1/jobs" + query_text(query);
  return read_job_page(call(request).body);
}

JobMessage Client::cancel(const std::string& id) {
  Call request;
  request.request.method = "POST";
  request.request.path = job_href(id) + ":cancel";
  return read_job(call(request).body);
}

JobMessage Client::retry(const std::string& id) {
  Call request;
  request.request.method = "POST";
  request.request.path = job_href(id) + ":retry";
  return read_job(call(request).body);
}

std::vector<ArtifactMessage> Client::artifacts(const std::string& id) {
  Call request;
  request.request.path = job_href(id) + "/artifacts";
  return read_artifact_list(call(request).body);
}

std::string Client::plan(const std::string& id) {
  Call request;
  request.request.path = job_href(id) + "/plan";
  return call(request).body;
}

std::string Client::accuracy(const std::string& id) {
  Call request;
  request.request.path = job_href(id) + "/accuracy";
  return call(request).body;
}

void Client::download(const std::string& id, const ArtifactMessage& artifact,
                      const std::filesystem::path& target) {
  PartFile part(target, artifact.bytes);
  const std::string path = artifact_href(id, artifact.name);
  for (int tried = 0; !part.complete(); ++tried) {
    double at_least_s = 0;
    const uint64_t before = part.size();
    try {
      Call request;
      request.request.path = path;
      if (before > 0)
        request.request.headers.emplace_back("Range", "bytes=" + std::to_string(before) + "-");
      request.request.on_head = [&](int status) { return status == 206 || part.restart(); };
      request.request.on_body = [&](const char* data, size_t size) {
        return part.append(data, size);
      };
      const Answer answer = call_once(request);
      const bool good = answer.status == 200 || answer.status == 206;
      if (!good && (!worth_another_try(answer.status) || tried >= options_.retries))
        throw ServerProblem(problem_of(answer));
      at_least_s = retry_after(answer);
      if (good && part.overrun()) break;
    } catch (const ServerProblem&) {
      throw;
    } catch (const Error& error) {
      if (part.overrun()) break;
      if (error.code() != ErrorCode::unavailable || tried >= options_.retries) throw;
    }
    if (part.size() > before) tried = -1;  // it goes forward: that is no failure in a row
    if (!part.complete() && !pause(std::max(tried, 0), at_least_s))
      throw Error(ErrorCode::cancelled, "The download was interrupted.");
  }
  part.finish(artifact.digest, artifact.name);
}

std::string new_idempotency_key() {
  static constexpr char kAlphabet[] = "abcdefghijklmnopqrstuvwxyz234567";
  std::random_device random;
  std::string key = "kiln-";
  for (int i = 0; i < 26; ++i) key += kAlphabet[random() & 31u];
  return key;
}

}  // namespace lightkiln
