#include "tests/http/raw_client.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <stdexcept>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace lightkiln::test {

namespace {
constexpr int kPatienceMs = 20000;
}  // namespace

RawClient::RawClient(int port, const char* from)
    : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in own{};
  own.sin_family = AF_INET;
  if (::inet_pton(AF_INET, from, &own.sin_addr) != 1 ||
      ::bind(fd_, reinterpret_cast<sockaddr*>(&own), sizeof own) != 0)
    throw std::runtime_error("cannot bind");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (fd_ < 0 || ::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error("cannot connect");
}

RawClient::~RawClient() {
  ::close(fd_);
}

bool RawClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

void RawClient::finish_sending() {
  ::shutdown(fd_, SHUT_WR);
}

bool RawClient::fill(int timeout_ms) {
  pollfd waited{fd_, POLLIN, 0};
  if (::poll(&waited, 1, timeout_ms) <= 0) throw std::runtime_error("the server says nothing");
  char data[65536];
  const ssize_t got = ::recv(fd_, data, sizeof data, 0);
  if (got <= 0) return false;
  buffer_.append(data, static_cast<size_t>(got));
  return true;
}

RawReply RawClient::receive(bool head) {
  RawReply reply;
  size_t end = 0;
  while ((end = buffer_.find("\r\n\r\n")) == std::string::npos)
    if (!fill(kPatienceMs)) return reply;
  std::string_view lines = std::string_view(buffer_).substr(0, end + 2);
  if (!lines.starts_with("HTTP/1.1 ")) throw std::runtime_error("not a status line");
  reply.status = std::stoi(std::string(lines.substr(9, 3)));
  lines.remove_prefix(lines.find("\r\n") + 2);
  while (!lines.empty()) {
    const size_t line_end = lines.find("\r\n");
    const std::string_view line = lines.substr(0, line_end);
    lines.remove_prefix(line_end + 2);
    const size_t colon = line.find(": ");
    if (colon == std::string_view::npos) throw std::runtime_error("a header without a colon");
    std::string name(line.substr(0, colon));
    std::transform(name.begin(), name.end(), name.begin(),
                   [](char c) { return static_cast<char>(std::tolower(c)); });
    if (!reply.headers.emplace(name, line.substr(colon + 2)).second)
      throw std::runtime_error("the header " + name + " came twice");
  }
  buffer_.erase(0, end + 4);
  if (reply.status == 100) return receive(head);
  if (head || reply.status == 204 || reply.status == 304) return reply;
  const size_t length = std::stoul(reply.header("content-length"));
  while (buffer_.size() < length)
    if (!fill(kPatienceMs)) throw std::runtime_error("the body is cut off");
  reply.body = buffer_.substr(0, length);
  buffer_.erase(0, length);
  return reply;
}

bool RawClient::closed_within(int ms) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(ms);
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    pollfd waited{fd_, POLLIN, 0};
    if (::poll(&waited, 1, static_cast<int>(left.count())) <= 0) return false;
    char data[4096];
    if (::recv(fd_, data, sizeof data, 0) <= 0) return true;
  }
}

RawReply request(int port, const std::string& method, const std::string& target,
                 const std::string& body, const std::string& headers) {
  RawClient client(port);
  std::string text =
      method + ' ' + target + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" + headers;
  if (!body.empty()) text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  client.send(text + "\r\n" + body);
  return client.receive(method == "HEAD");
}

RawReply get(int port, const std::string& target, const std::string& headers) {
  return request(port, "GET", target, "", headers);
}

RawReply post(int port, const std::string& target, const std::string& json,
              const std::string& headers) {
  return request(port, "POST", target, json, "Content-Type: application/json\r\n" + headers);
}

}  // namespace lightkiln::test
