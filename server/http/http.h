#pragma once

// Requests and replies as plain structs. The fence makes the first and sends the second; routes see
// nothing of sockets or of the HTTP library.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace lightkiln {

using HttpHeaders = std::vector<std::pair<std::string, std::string>>;

// A request line and its headers, already through every rule of head.h.
struct HttpHead {
  std::string method;                                      // upper case, a token
  std::string target;                                      // as sent, at most 1 KiB
  std::string path;                                        // target up to '?', still encoded
  std::vector<std::string> segments;                       // decoded; "/" has none
  std::vector<std::pair<std::string, std::string>> query;  // decoded, in order
  HttpHeaders headers;                                     // names in lower case
  uint64_t content_length = 0;                             // 0 when absent
  bool close = false;                                      // the peer wants the connection closed
  bool expects_continue = false;
  std::string peer;        // numeric address of the other side
  std::string request_id;  // the client's X-Request-Id when it is plain, else our own

  // The value of a header (name in lower case), or null. Repeated headers give the first.
  const std::string* header(std::string_view name) const;
  // The value of a query parameter, or null.
  const std::string* parameter(std::string_view name) const;
};

// Thrown by what serves a request to answer it with a status of the HTTP layer's own.
struct HttpRefusal {
  int status = 400;
  std::string detail;
};

// A body that is read while it arrives. read() gives at most `size` bytes, 0 at the end, and throws
// HttpRefusal when the peer is slower than the fence allows (408) or hangs up (400).
class BodyReader {
 public:
  virtual ~BodyReader() = default;
  virtual size_t read(char* data, size_t size) = 0;
};

struct IncomingRequest {
  HttpHead head;
  std::string body;              // whole, when the route buffers bodies
  BodyReader* reader = nullptr;  // never null when the route streams bodies
};

// An open file (or a part of it) as a reply's body; closed with the last copy.
struct FileBody {
  std::shared_ptr<const int> descriptor;
  uint64_t offset = 0;
  uint64_t length = 0;
};
// Takes ownership of an open descriptor.
std::shared_ptr<const int> own_descriptor(int descriptor);

struct HttpReply {
  int status = 200;
  std::string media_type;  // "" = no Content-Type
  HttpHeaders headers;
  std::string body;
  std::optional<FileBody> file;  // instead of `body`

  HttpReply& set(std::string name, std::string value) {
    headers.emplace_back(std::move(name), std::move(value));
    return *this;
  }
};

enum class BodyRule {
  none,      // a body is refused
  buffered,  // read whole before a thread is taken
  streamed,  // the handler reads it
};

// What may happen to a request, decided from its head alone before its body is read.
struct Admission {
  BodyRule body = BodyRule::none;
  uint64_t body_limit = 0;           // bytes; over it: 413
  std::optional<HttpReply> refusal;  // answered at once, the body is not read
};

// One line of the access log.
struct ServedRequest {
  const HttpHead& head;
  int status = 0;
  uint64_t reply_bytes = 0;
  double seconds = 0;
};

// The application behind the fence. `admit` and `served` run on the one thread that watches all
// sockets and must not block; `handle` runs on a pool thread and may throw Error.
struct HttpApplication {
  std::function<Admission(const HttpHead&)> admit;
  std::function<HttpReply(IncomingRequest&)> handle;
  std::function<void(const ServedRequest&)> served;
};

}  // namespace lightkiln
