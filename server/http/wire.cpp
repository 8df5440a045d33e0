#include "server/http/wire.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <ctime>
#include <string_view>

#include <httplib.h>

#include "core/base/error.h"

namespace lightkiln {

namespace {

// A conversation in memory: the library reads a request line of our own making and writes into a
// string.
class MemoryStream : public httplib::Stream {
 public:
  explicit MemoryStream(std::string_view input) : input_(input) {}

  bool is_readable() const override { return !input_.empty(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* data, size_t size) override {
    const size_t got = std::min(size, input_.size());
    std::memcpy(data, input_.data(), got);
    input_.remove_prefix(got);
    return static_cast<ssize_t>(got);
  }
  ssize_t write(const char* data, size_t size) override {
    output_.append(data, size);
    return static_cast<ssize_t>(size);
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return -1; }

  std::string take() { return std::move(output_); }

 private:
  std::string_view input_;
  std::string output_;
};

// RFC 9110, section 5.6.7.
std::string http_date() {
  thread_local time_t last = 0;
  thread_local std::string text;
  const time_t now = std::time(nullptr);
  if (now != last) {
    tm parts{};
    gmtime_r(&now, &parts);
    char buffer[40];
    const size_t size = std::strftime(buffer, sizeof buffer, "%a, %d %b %Y %H:%M:%S GMT", &parts);
    text.assign(buffer, size);
    last = now;
  }
  return text;
}

std::string without_control_bytes(std::string value) {
  for (char& c : value)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return value;
}

thread_local const HttpReply* reply_in_hand = nullptr;

}  // namespace

struct Wire::Library : httplib::Server {
  Library(int keep_alive_s, int keep_alive_requests) {
    set_keep_alive_timeout(keep_alive_s);
    set_keep_alive_max_count(static_cast<size_t>(keep_alive_requests));
    // Not the library's default, SO_REUSEPORT: with it a second daemon would silently share the
    // port and half of the requests.
    set_socket_options([](socket_t fd) {
      const int on = 1;
      ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    set_pre_routing_handler([](const httplib::Request&, httplib::Response& response) {
      fill(*reply_in_hand, response);
      return HandlerResponse::Handled;
    });
  }

  static void fill(const HttpReply& reply, httplib::Response& response) {
    response.status = reply.status;
    for (const auto& [name, value] : reply.headers)
      response.set_header(name, without_control_bytes(value));
    response.set_header("Date", http_date());
    if (!reply.media_type.empty()) response.set_header("Content-Type", reply.media_type);
    if (reply.file) {
      response.set_header("Content-Length", std::to_string(reply.file->length));
    } else {
      response.body = reply.body;
      if (!response.has_header("Accept-Ranges")) response.set_header("Accept-Ranges", "none");
    }
  }

  std::string render(std::string_view request, bool close) {
    MemoryStream stream(request);
    bool connection_closed = false;
    process_request(stream, close, connection_closed, nullptr);
    return stream.take();
  }

  int listening() const { return svr_sock_; }
  void forget() {
    const socket_t held = svr_sock_.exchange(INVALID_SOCKET);
    if (held != INVALID_SOCKET) ::close(held);
  }

 private:
  // The library's own reader of sockets is never used: see fence.h.
  bool process_and_close_socket(socket_t socket) override {
    ::close(socket);
    return false;
  }
};

Wire::Wire(int keep_alive_s, int keep_alive_requests)
    : library_(std::make_unique<Library>(keep_alive_s, keep_alive_requests)) {}

Wire::~Wire() {
  close_socket();
}

int Wire::listen(const std::string& host, int port, int backlog) {
  const int bound = port == 0 ? library_->bind_to_any_port(host)
                              : (library_->bind_to_port(host, port) ? port : -1);
  if (bound < 0)
    throw Error(ErrorCode::unavailable, "The address " + host + ":" + std::to_string(port) +
                                            " cannot be listened on; it may be in use.");
  // The library's backlog is 5; calling listen again raises it.
  ::listen(library_->listening(), backlog);
  return bound;
}

int Wire::socket() const {
  return library_->listening();
}
void Wire::close_socket() {
  library_->forget();
}

std::string Wire::render(const HttpHead& head, const HttpReply& reply, bool close) const {
  const bool empty = reply.status == 204 || reply.status == 304;
  const bool head_only = empty || reply.file || head.method == "HEAD";
  reply_in_hand = &reply;
  std::string text =
      library_->render(head_only ? "HEAD / HTTP/1.1\r\n\r\n" : "GET / HTTP/1.1\r\n\r\n", close);
  reply_in_hand = nullptr;
  if (empty) {
    // RFC 9110, section 8.6: no Content-Length with 204, and none but the true one with 304. The
    // library always writes 0.
    static constexpr std::string_view kLength = "Content-Length: 0\r\n";
    const size_t at = text.find(kLength);
    if (at != std::string::npos) text.erase(at, kLength.size());
  }
  return text;
}

}  // namespace lightkiln
