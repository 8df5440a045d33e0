#pragma once

// One HTTP exchange. client_transport.cpp is the only user of httplib's client.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace lightkiln {

struct Endpoint {
  std::string url;  // "http://host:port" or "https://host:port"
  double connect_timeout_s = 5;
};
// Throws Error{invalid_input} unless the URL is a scheme and a host with an optional port.
Endpoint parse_endpoint(const std::string& url);

struct HttpRequest {
  std::string method = "GET";
  std::string path = "/";  // with the query, percent-encoded
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  std::string content_type;  // "" = no body
  // When not empty the body is this file, streamed; `file_bytes` is its size.
  std::filesystem::path file;
  uint64_t file_bytes = 0;
  double read_timeout_s = 30;  // the longest silence of the server
  // Gets the body of a 200 or 206 piece by piece when set, after on_head(status) allowed it;
  // returning false ends the exchange.
  std::function<bool(int status)> on_head;
  std::function<bool(const char* data, size_t size)> on_body;
  // Asked between pieces; true ends the exchange with Error{cancelled}.
  std::function<bool()> cancelled;
};

struct HttpResponse {
  int status = 0;
  std::map<std::string, std::string> headers;  // keys in lower case
  std::string body;                            // at most kMaxResponseBytes
};
inline constexpr size_t kMaxResponseBytes = size_t{64} << 20;

// Throws Error{unavailable} when no answer came, saying why.
HttpResponse exchange(const Endpoint& endpoint, const HttpRequest& request);

}  // namespace lightkiln
