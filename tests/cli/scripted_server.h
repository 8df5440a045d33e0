#pragma once

// A server on loopback that answers by a script: what a real daemon would never send, or not on
// demand.

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace lightkiln::test {

struct ScriptedRequest {
  std::string method, path, head, body;
  // A header's value, "" when it is not there. The name as kiln writes it.
  std::string header(const std::string& name) const;
};

class ScriptedServer {
 public:
  // Gives the whole answer as bytes; the connection is closed after them.
  using Script = std::function<std::string(const ScriptedRequest&)>;
  explicit ScriptedServer(Script script);
  ~ScriptedServer();

  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_); }
  std::vector<ScriptedRequest> requests() const;

 private:
  void serve();

  Script script_;
  int socket_ = -1;
  int port_ = 0;
  std::atomic<bool> stopping_{false};
  mutable std::mutex mutex_;
  std::vector<ScriptedRequest> requests_;
  std::thread thread_;
};

std::string http_answer(int status, const std::string& body,
                        const std::string& type = "application/json",
                        const std::string& more_headers = "");

}  // namespace lightkiln::test
