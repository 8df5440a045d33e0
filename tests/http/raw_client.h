#pragma once

// A client that says exactly what it is told to, byte by byte, and reads replies strictly.

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

namespace lightkiln::test {

struct RawReply {
  int status = 0;                              // 0: the connection closed without a reply
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;

  std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? "" : found->second;
  }
};

class RawClient {
 public:
  explicit RawClient(int port, const char* from = "127.0.0.1");
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // False when the peer has closed.
  bool send(std::string_view bytes);
  // One reply, with `Connection: close` bodies read to the end. `head` says that none has a body.
  RawReply receive(bool head = false);
  // Whether the peer closes within the time, ignoring what it still sends.
  bool closed_within(int ms);
  void finish_sending();
  int fd() const { return fd_; }

 private:
  bool fill(int timeout_ms);
  int fd_ = -1;
  std::string buffer_;
};

// One request on a connection of its own, with Host and Connection: close.
RawReply request(int port, const std::string& method, const std::string& target,
                 const std::string& body = "", const std::string& headers = "");
RawReply get(int port, const std::string& target, const std::string& headers = "");
// With Content-Type: application/json.
RawReply post(int port, const std::string& target, const std::string& json,
              const std::string& headers = "");

}  // namespace lightkiln::test
