#pragma once

// The route table. A handler is always the same steps: parse, call the store, say what came of it.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/api.h"

namespace lightkiln {

// Requests served, for /metrics.
class RequestCounts {
 public:
  void count(const std::string& method, int status, double seconds);
  void write(std::string& text) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::pair<std::string, int>, uint64_t> requests_;
  double seconds_ = 0;
};

// Places for requests that hold a thread while they wait.
class Waiters {
 public:
  explicit Waiters(int places) : places_(places) {}
  bool enter() {
    if (taken_.fetch_add(1) < places_) return true;
    taken_.fetch_sub(1);
    return false;
  }
  void leave() { taken_.fetch_sub(1); }
  void stop() { stopped_ = true; }
  bool stopped() const { return stopped_; }

 private:
  const int places_;
  std::atomic<int> taken_{0};
  std::atomic<bool> stopped_{false};
};

struct RouteContext {
  Store& store;
  Log& log;
  const ApiOptions& options;
  Waiters waiters;
  RequestCounts counts;
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
};

struct RouteCall {
  IncomingRequest& request;
  std::vector<std::string> values;  // of the pattern's parameters
};
using Handler = HttpReply (*)(RouteContext&, RouteCall&);

struct Route {
  const char* method;
  const char* pattern;
  Scope scope;
  BodyRule body;
  std::vector<const char*> query;  // allowed parameters
  Handler handle;
};
std::vector<Route> job_routes();
std::vector<Route> artifact_routes();
std::vector<Route> blob_routes();
std::vector<Route> service_routes();
std::vector<Route> all_routes();

// --- small things that handlers share
// -------------------------------------------------------------

HttpReply json_reply(std::string json, int status = 200);
// With an entity tag; 304 when the client has it already.
HttpReply tagged_reply(const HttpHead& head, std::string json, const std::string& etag);
// An integer query parameter; throws HttpRefusal naming what is allowed.
int64_t integer_parameter(const HttpHead& head, const char* name, int64_t fallback, int64_t least,
                          int64_t most);
// Seconds of `Prefer: wait=N`, at most kMaxWaitSeconds; 0 without it.
int preferred_wait_s(const HttpHead& head);
// Error{not_found} when there is no such job.
JobRecord need_job(Store& store, const std::string& id);
// Sleeps until the job's version exceeds `version`, it is terminal, or the time is over, if a place
// for waiting is free. True when it waited (or needed not to).
bool wait_for_job(RouteContext& context, JobRecord& job, uint64_t version, int wait_s);

}  // namespace lightkiln
