#pragma once

// The REST API over a store: the application that a fence carries.

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/http/gate.h"
#include "server/http/http.h"
#include "server/http/log.h"
#include "server/store/store.h"

namespace lightkiln {

struct ApiOptions {
  std::vector<std::string> hosts;  // allowed in Host besides loopback names
  std::vector<Token> tokens;       // none: open to whoever reaches the socket
  uint64_t max_blob_bytes = 512ull << 20;
  int max_waiters = 32;  // requests that may hold a thread for `Prefer: wait`; more are answered at
                         // once
};

// One row of the route table.
struct RouteInfo {
  std::string method;
  std::string pattern;  // as in openapi.json
  Scope scope = Scope::open;
};

class Api {
 public:
  // `store` and `log` outlive the object.
  Api(Store& store, Log& log, ApiOptions options);
  ~Api();
  Api(const Api&) = delete;
  Api& operator=(const Api&) = delete;

  // Refers to this object.
  HttpApplication application();
  // Lets requests that wait for a job answer at once, for good.
  void stop_waiting();

  std::vector<RouteInfo> routes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lightkiln
