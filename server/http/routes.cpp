#include "server/http/routes.h"

#include <algorithm>
#include <charconv>

#include "proto/messages.h"
#include "server/http/ranges.h"

namespace lightkiln {

std::vector<Route> all_routes() {
  std::vector<Route> all;
  for (const auto& some : {job_routes(), artifact_routes(), blob_routes(), service_routes()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

HttpReply json_reply(std::string json, int status) {
  HttpReply reply;
  reply.status = status;
  reply.media_type = "application/json";
  reply.body = std::move(json);
  reply.set("Cache-Control", "no-store");
  return reply;
}

HttpReply tagged_reply(const HttpHead& head, std::string json, const std::string& etag) {
  if (none_match_hits(head, etag)) return not_modified(etag);
  HttpReply reply;
  reply.media_type = "application/json";
  reply.body = std::move(json);
  reply.set("ETag", etag).set("Cache-Control", "private, no-cache");
  return reply;
}

int64_t integer_parameter(const HttpHead& head, const char* name, int64_t fallback, int64_t least,
                          int64_t most) {
  const std::string* text = head.parameter(name);
  if (!text) return fallback;
  int64_t value = 0;
  const char* end = text->data() + text->size();
  const auto result = std::from_chars(text->data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || value < least || value > most)
    throw HttpRefusal{400, "The query parameter '" + std::string(name) +
                               "' must be an integer from " + std::to_string(least) + " to " +
                               std::to_string(most) + "."};
  return value;
}

int preferred_wait_s(const HttpHead& head) {
  const std::string* prefer = head.header("prefer");
  if (!prefer) return 0;
  std::string_view rest = *prefer;
  while (!rest.empty()) {
    const size_t comma = std::min(rest.find(','), rest.size());
    std::string_view one = rest.substr(0, comma);
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    while (!one.empty() && one.front() == ' ') one.remove_prefix(1);
    while (!one.empty() && one.back() == ' ') one.remove_suffix(1);
    if (!one.starts_with("wait=")) continue;
    int seconds = 0;
    const auto result = std::from_chars(one.data() + 5, one.data() + one.size(), seconds);
    // RFC 7240, section 2: a preference that makes no sense is ignored.
    if (result.ec == std::errc::invalid_argument || result.ptr != one.data() + one.size() ||
        seconds < 0)
      continue;
    return result.ec == std::errc() ? std::min(seconds, kMaxWaitSeconds) : kMaxWaitSeconds;
  }
  return 0;
}

JobRecord need_job(Store& store, const std::string& id) {
  std::optional<JobRecord> job = store.find_job(id);
  if (!job) throw Error(ErrorCode::not_found, "There is no such job.");
  return *std::move(job);
}

bool wait_for_job(RouteContext& context, JobRecord& job, uint64_t version, int wait_s) {
  // Short turns, so that a daemon that shuts down is not held up.
  constexpr int64_t kTurnMs = 250;
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds(wait_s);
  const auto settled = [&] { return job.version > version || is_terminal(job.state); };
  if (settled()) return true;
  if (!context.waiters.enter()) return false;
  struct Leave {
    Waiters& waiters;
    ~Leave() { waiters.leave(); }
  } leave{context.waiters};
  while (!settled() && !context.waiters.stopped()) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0) break;
    const std::string id = job.id;
    auto next = context.store.wait_job(id, version, std::min<int64_t>(left, kTurnMs));
    if (!next) throw Error(ErrorCode::not_found, "There is no such job.");
    job = *std::move(next);
  }
  return true;
}

}  // namespace lightkiln
