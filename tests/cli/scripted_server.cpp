#include "tests/cli/scripted_server.h"

#include <stdexcept>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace lightkiln::test {
namespace {

ScriptedRequest read_request(int client) {
  std::string bytes;
  char piece[4096];
  size_t end = std::string::npos;
  size_t length = 0;
  ScriptedRequest request;
  while (true) {
    end = bytes.find("\r\n\r\n");
    if (end != std::string::npos) {
      request.head = bytes.substr(0, end + 2);
      const std::string text = request.header("Content-Length");
      length = text.empty() ? 0 : std::stoul(text);
      if (bytes.size() >= end + 4 + length) break;
    }
    const ssize_t got = recv(client, piece, sizeof piece, 0);
    if (got <= 0) return request;
    bytes.append(piece, static_cast<size_t>(got));
  }
  request.body = bytes.substr(end + 4, length);
  const size_t first = bytes.find(' ');
  request.method = bytes.substr(0, first);
  request.path = bytes.substr(first + 1, bytes.find(' ', first + 1) - first - 1);
  return request;
}

}  // namespace

std::string ScriptedRequest::header(const std::string& name) const {
  const size_t at = head.find("\r\n" + name + ": ");
  if (at == std::string::npos) return "";
  const size_t begin = at + name.size() + 4;
  return head.substr(begin, head.find("\r\n", begin) - begin);
}

ScriptedServer::ScriptedServer(Script script) : script_(std::move(script)) {
  socket_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (bind(socket_, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(socket_, 16) != 0 ||
      getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("cannot listen");
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { serve(); });
}

ScriptedServer::~ScriptedServer() {
  stopping_ = true;
  shutdown(socket_, SHUT_RDWR);
  thread_.join();
  close(socket_);
}

std::vector<ScriptedRequest> ScriptedServer::requests() const {
  const std::lock_guard lock(mutex_);
  return requests_;
}

void ScriptedServer::serve() {
  while (!stopping_) {
    const int client = accept(socket_, nullptr, nullptr);
    if (client < 0) continue;
    const ScriptedRequest request = read_request(client);
    {
      const std::lock_guard lock(mutex_);
      requests_.push_back(request);
    }
    const std::string answer = script_(request);
    size_t sent = 0;
    while (sent < answer.size()) {
      const ssize_t count = send(client, answer.data() + sent, answer.size() - sent, MSG_NOSIGNAL);
      if (count <= 0) break;
      sent += static_cast<size_t>(count);
    }
    shutdown(client, SHUT_WR);
    close(client);
  }
}

std::string http_answer(int status, const std::string& body, const std::string& type,
                        const std::string& more_headers) {
  return "HTTP/1.1 " + std::to_string(status) + " X\r\nContent-Type: " + type +
         "\r\nContent-Length: " + std::to_string(body.size()) + "\r\nConnection: close\r\n" +
         more_headers + "\r\n" + body;
}

}  // namespace lightkiln::test
