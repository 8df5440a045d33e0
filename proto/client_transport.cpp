// httplib's client behind a narrow seam: one connection an exchange, no redirects, no compression,
// bodies limited or streamed.

#include "proto/client_transport.h"

#include <algorithm>
#include <cctype>
#include <fstream>

#include <httplib.h>

#include "core/base/error.h"

namespace lightkiln {
namespace {

constexpr size_t kUploadPiece = 1 << 16;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

const char* failure_text(httplib::Error error) {
  switch (error) {
    case httplib::Error::Connection:
    case httplib::Error::ConnectionTimeout:
      return "no connection";
    case httplib::Error::Read:
      return "it did not answer in time or closed the connection";
    case httplib::Error::Write:
      return "it closed the connection while reading";
    case httplib::Error::SSLConnection:
    case httplib::Error::SSLLoadingCerts:
    case httplib::Error::SSLServerVerification:
      return "its certificate or TLS could not be verified";
    default:
      return "the exchange failed";
  }
}

void set_timeouts(httplib::Client& client, const Endpoint& endpoint, const HttpRequest& request) {
  const auto microseconds = [](double seconds) {
    return std::chrono::microseconds(static_cast<int64_t>(seconds * 1e6));
  };
  client.set_connection_timeout(microseconds(endpoint.connect_timeout_s));
  client.set_read_timeout(microseconds(request.read_timeout_s));
  client.set_write_timeout(microseconds(request.read_timeout_s));
}

// Streams the file from `offset` on.
httplib::ContentProvider file_provider(const HttpRequest& request, std::ifstream& file) {
  return [&request, &file](size_t offset, size_t length, httplib::DataSink& sink) {
    if (request.cancelled && request.cancelled()) return false;
    char piece[kUploadPiece];
    file.clear();
    file.seekg(static_cast<std::streamoff>(offset));
    file.read(piece, static_cast<std::streamsize>(std::min(length, sizeof piece)));
    if (file.gcount() <= 0) return false;
    return sink.write(piece, static_cast<size_t>(file.gcount()));
  };
}

}  // namespace

Endpoint parse_endpoint(const std::string& url) {
  const bool plain = url.starts_with("http://");
  const bool secure = url.starts_with("https://");
  std::string host = plain ? url.substr(7) : secure ? url.substr(8) : "";
  while (host.ends_with('/')) host.pop_back();
  const std::string allowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_:[]";
  const size_t colon = host.rfind(':');
  const std::string port =
      colon == std::string::npos || host.ends_with(']') ? "" : host.substr(colon + 1);
  const bool port_good = port.size() <= 5 &&
                         port.find_first_not_of("0123456789") == std::string::npos &&
                         (port.empty() || (std::stoi(port) >= 1 && std::stoi(port) <= 65535));
  if (host.empty() || host[0] == ':' || host.find_first_not_of(allowed) != std::string::npos ||
      !port_good)
    throw Error(ErrorCode::invalid_input,
                "The server \"" + url + "\" must read http://host:port or https://host:port.");
  Endpoint endpoint;
  endpoint.url = (plain ? "http://" : "https://") + host;
  return endpoint;
}

HttpResponse exchange(const Endpoint& endpoint, const HttpRequest& request) {
  httplib::Client client(endpoint.url);
  if (!client.is_valid())
    throw Error(ErrorCode::invalid_input, "The server \"" + endpoint.url + "\" cannot be used.");
  set_timeouts(client, endpoint, request);
  client.set_keep_alive(false);
  client.set_tcp_nodelay(true);
  client.set_decompress(false);
  client.set_follow_location(false);

  httplib::Request wire;
  wire.method = request.method;
  wire.path = request.path;
  for (const auto& [name, value] : request.headers) wire.set_header(name, value);
  std::ifstream file;
  if (!request.file.empty()) {
    file.open(request.file, std::ios::binary);
    if (!file)
      throw Error(ErrorCode::not_found,
                  "The file " + request.file.string() + " cannot be read any more.");
    wire.set_header("Content-Type", request.content_type);
    if (request.file_bytes > 0) {
      wire.content_length_ = static_cast<size_t>(request.file_bytes);
      wire.content_provider_ = file_provider(request, file);
      wire.set_header("Content-Length", std::to_string(request.file_bytes));
    }
  } else if (!request.content_type.empty()) {
    wire.set_header("Content-Type", request.content_type);
    wire.body = request.body;
  }

  HttpResponse response;
  bool too_long = false;
  bool refused = false;
  wire.response_handler = [&](const httplib::Response& head) {
    response.status = head.status;
    const bool good = head.status == 200 || head.status == 206;
    refused = good && request.on_head && !request.on_head(head.status);
    return !refused;
  };
  wire.content_receiver = [&](const char* data, size_t size, uint64_t, uint64_t) {
    if (request.cancelled && request.cancelled()) return false;
    if (request.on_body && (response.status == 200 || response.status == 206))
      return request.on_body(data, size);
    too_long = response.body.size() + size > kMaxResponseBytes;
    if (!too_long) response.body.append(data, size);
    return !too_long;
  };
  const httplib::Result result = client.send(wire);
  if (request.cancelled && request.cancelled())
    throw Error(ErrorCode::cancelled, "The exchange was interrupted.");
  if (too_long)
    throw Error(ErrorCode::unavailable, "The answer of " + endpoint.url + " is too long.");
  if (refused) return response;
  if (!result)
    throw Error(ErrorCode::unavailable, "The server " + endpoint.url + " cannot be reached: " +
                                            failure_text(result.error()) + ".");
  response.status = result->status;
  for (const auto& [name, value] : result->headers) response.headers[lower(name)] = value;
  return response;
}

}  // namespace lightkiln
