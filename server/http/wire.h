#pragma once

// The only user of cpp-httplib's server: it opens the listening socket and turns replies into
// bytes.

#include <memory>
#include <string>

#include "server/http/http.h"

namespace lightkiln {

class Wire {
 public:
  // The two numbers are announced to clients in `Keep-Alive`.
  Wire(int keep_alive_s, int keep_alive_requests);
  ~Wire();
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  // Listens without blocking; port 0 takes a free one. Gives the port and the socket, which stays
  // ours. Throws Error{unavailable}.
  int listen(const std::string& host, int port, int backlog);
  int socket() const;
  void close_socket();

  // The reply as it goes on the wire: status line, headers, and the body unless it is a file or the
  // method or status allow none. Thread-safe.
  std::string render(const HttpHead& head, const HttpReply& reply, bool close) const;

 private:
  struct Library;
  std::unique_ptr<Library> library_;
};

}  // namespace lightkiln
