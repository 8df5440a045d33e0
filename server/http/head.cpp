#include "server/http/head.h"

#include <algorithm>
#include <cstdint>

namespace lightkiln {

namespace {

// RFC 9110, section 5.6.2.
bool is_token_char(char c) {
  if ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9')) return true;
  return c != '\0' && std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}
bool is_token(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), is_token_char);
}

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}
std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = lower(c);
  return result;
}

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

HeadFault bad(std::string detail) {
  return {400, std::move(detail)};
}

std::optional<HeadFault> parse_query(std::string_view text, HttpHead& head) {
  while (!text.empty()) {
    const size_t end = std::min(text.find('&'), text.size());
    const std::string_view pair = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (pair.empty()) continue;
    const size_t equals = std::min(pair.find('='), pair.size());
    std::string value(pair.substr(std::min(equals + 1, pair.size())));
    std::replace(value.begin(), value.end(), '+', ' ');
    const auto name = decode_percent(pair.substr(0, equals));
    const auto decoded = decode_percent(value);
    if (!name || !decoded) return bad("The query holds a broken or forbidden percent escape.");
    head.query.emplace_back(*name, *decoded);
  }
  return std::nullopt;
}

std::optional<HeadFault> parse_target(std::string_view target, HttpHead& head) {
  if (target.empty() || target.front() != '/')
    return bad("The request target must be a path that begins with '/'.");
  for (const char c : target)
    if (c <= 0x20 || c == 0x7f || c == '#' || c == '\\')
      return bad("The request target holds a byte that no URI may hold.");
  const size_t question = std::min(target.find('?'), target.size());
  head.target = std::string(target);
  head.path = std::string(target.substr(0, question));
  std::string_view rest = std::string_view(head.path).substr(1);
  while (!rest.empty()) {
    const size_t slash = std::min(rest.find('/'), rest.size());
    const auto segment = decode_percent(rest.substr(0, slash));
    if (!segment) return bad("The path holds a broken or forbidden percent escape.");
    if (segment->find_first_of("/\\") != std::string::npos || *segment == "." || *segment == "..")
      return bad("The path holds a dot segment or an escaped separator.");
    head.segments.push_back(*segment);
    if (slash + 1 == rest.size()) head.segments.emplace_back();  // a trailing '/' is a segment
    rest.remove_prefix(std::min(slash + 1, rest.size()));
  }
  return parse_query(target.substr(std::min(question + 1, target.size())), head);
}

std::optional<HeadFault> parse_request_line(std::string_view line, HttpHead& head) {
  const size_t first = line.find(' ');
  const size_t last = line.rfind(' ');
  if (first == std::string_view::npos || last == first)
    return bad("The request line must be: method, one space, target, one space, version.");
  const std::string_view method = line.substr(0, first);
  const std::string_view version = line.substr(last + 1);
  if (!is_token(method) || method.size() > 16) return bad("The method is not a token.");
  head.method = std::string(method);
  if (version != "HTTP/1.1" && version != "HTTP/1.0")
    return HeadFault{505, "The protocol version must be HTTP/1.1 or HTTP/1.0."};
  head.close = version == "HTTP/1.0";
  return parse_target(line.substr(first + 1, last - first - 1), head);
}

std::optional<HeadFault> parse_header_line(std::string_view line, HttpHead& head) {
  if (line.front() == ' ' || line.front() == '\t')
    return bad("A header is folded over several lines; write it on one.");
  const size_t colon = line.find(':');
  if (colon == std::string_view::npos) return bad("A header line has no colon.");
  const std::string_view name = line.substr(0, colon);
  if (!is_token(name))
    return bad("A header name is empty or holds a space or another illegal byte.");
  const std::string_view value = trim(line.substr(colon + 1));
  for (const char c : value)
    if ((c >= 0 && c < 0x20 && c != '\t') || c == 0x7f)
      return bad("A header value holds a control byte.");
  std::string lowered = lower(name);
  std::replace(lowered.begin(), lowered.end(), '_', '-');
  if (lowered.starts_with("remote-") || lowered.starts_with("local-"))
    return bad("Headers named REMOTE_* or LOCAL_* are not taken from clients.");
  // Programs behind or before us may read '_' as '-' (RFC 3875, section 4.1.18) and frame by it.
  static constexpr std::string_view kFraming[] = {"transfer-encoding", "content-length", "host",
                                                  "connection",        "expect",         "te",
                                                  "trailer",           "upgrade"};
  if (name.find('_') != std::string_view::npos &&
      std::find(std::begin(kFraming), std::end(kFraming), lowered) != std::end(kFraming))
    return bad("A header that frames the request is spelt with '_' instead of '-'.");
  head.headers.emplace_back(lower(name), std::string(value));
  return std::nullopt;
}

std::optional<HeadFault> parse_length(HttpHead& head) {
  size_t hosts = 0, lengths = 0;
  bool coded = false;
  for (const auto& [name, value] : head.headers) {
    if (name == "host") ++hosts;
    if (name == "transfer-encoding") coded = true;
    if (name != "content-length") continue;
    ++lengths;
    if (value.empty() || value.size() > 15 ||
        !std::all_of(value.begin(), value.end(), [](char c) { return c >= '0' && c <= '9'; }))
      return bad("Content-Length must be 1 to 15 decimal digits.");
    head.content_length = std::stoull(value);
  }
  if (hosts != 1) return bad("A request must carry exactly one Host header.");
  if (lengths > 1) return bad("A request must not carry more than one Content-Length header.");
  if (coded && lengths > 0)
    return bad("Transfer-Encoding and Content-Length must not be sent together.");
  if (coded)
    return HeadFault{411, "Transfer-Encoding is not accepted; send a body with Content-Length."};
  if (head.content_length > 0 && (head.method == "GET" || head.method == "HEAD"))
    return bad("A GET or HEAD request must not carry a body.");
  return std::nullopt;
}

std::optional<HeadFault> check_semantics(const HeadLimits& limits, HttpHead& head) {
  for (const auto& [name, value] : head.headers) {
    if (name == "content-encoding")
      return HeadFault{415, "Content-Encoding is not accepted; send the body as it is."};
    if (name == "content-type" && lower(value).starts_with("multipart/"))
      return HeadFault{415, "Multipart bodies are not accepted; send the raw bytes."};
    if (name == "range" && (value.size() > limits.range || value.find(',') != std::string::npos))
      return HeadFault{416, "One range of at most 64 bytes of text is accepted."};
    if (name == "expect") {
      if (lower(value) != "100-continue")
        return HeadFault{417, "The only expectation that is met is 100-continue."};
      head.expects_continue = true;
    }
    if (name == "connection" && lower(value).find("close") != std::string::npos) head.close = true;
  }
  return std::nullopt;
}

}  // namespace

const std::string* HttpHead::header(std::string_view name) const {
  for (const auto& [key, value] : headers)
    if (key == name) return &value;
  return nullptr;
}

const std::string* HttpHead::parameter(std::string_view name) const {
  for (const auto& [key, value] : query)
    if (key == name) return &value;
  return nullptr;
}

HeadScan scan_head(std::string_view bytes, const HeadLimits& limits) {
  size_t line_start = 0, lines = 0;
  for (;;) {
    const size_t feed = bytes.substr(0, limits.bytes).find('\n', line_start);
    if (feed == std::string_view::npos) break;
    if (feed == line_start || bytes[feed - 1] != '\r')
      return {0, bad("A line of the head ends in a bare line feed; lines end in CR LF.")};
    const size_t line = feed - 1 - line_start;
    if (line == 0) {
      if (lines == 0) return {0, bad("The request begins with an empty line.")};
      return {feed + 1, std::nullopt};
    }
    if (lines == 0 && line > limits.request_line) break;
    if (++lines > limits.lines)
      return {0, HeadFault{431, "A request head may have at most " + std::to_string(limits.lines) +
                                    " lines."}};
    line_start = feed + 1;
  }
  if (lines == 0 && bytes.size() > limits.request_line + 2)
    return {0, HeadFault{414, "The request line may be at most " +
                                  std::to_string(limits.request_line) + " bytes long."}};
  if (bytes.size() >= limits.bytes)
    return {0, HeadFault{431, "A request head may be at most " + std::to_string(limits.bytes) +
                                  " bytes long."}};
  return {};
}

std::optional<HeadFault> parse_head(std::string_view bytes, const HeadLimits& limits,
                                    HttpHead& head) {
  bool first = true;
  while (!bytes.empty()) {
    const size_t end = bytes.find("\r\n");
    if (end == std::string_view::npos) return bad("A line of the head does not end in CR LF.");
    const std::string_view line = bytes.substr(0, end);
    bytes.remove_prefix(end + 2);
    if (line.empty()) break;
    const auto fault = first ? parse_request_line(line, head) : parse_header_line(line, head);
    if (fault) return fault;
    first = false;
  }
  if (first) return bad("The request line is missing.");
  if (auto fault = parse_length(head)) return fault;
  return check_semantics(limits, head);
}

std::optional<std::string> decode_percent(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = hex_value(text[i + 1]), low = hex_value(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    result += c;
  }
  if (!is_utf8(result)) return std::nullopt;
  return result;
}

// The table of well-formed byte sequences: Unicode 15, table 3-7.
bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = [&](size_t k) -> int {
      return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : -1;
    };
    const int lead = byte(0);
    size_t more = 0;
    int low = 0x80, high = 0xbf;
    if (lead < 0x80) {
      ++i;
      continue;
    }
    if (lead >= 0xc2 && lead <= 0xdf) more = 1;
    if (lead >= 0xe0 && lead <= 0xef) more = 2;
    if (lead >= 0xf0 && lead <= 0xf4) more = 3;
    if (more == 0) return false;
    if (lead == 0xe0) low = 0xa0;
    if (lead == 0xed) high = 0x9f;
    if (lead == 0xf0) low = 0x90;
    if (lead == 0xf4) high = 0x8f;
    for (size_t k = 1; k <= more; ++k) {
      if (byte(k) < low || byte(k) > high) return false;
      low = 0x80;
      high = 0xbf;
    }
    i += more + 1;
  }
  return true;
}

}  // namespace lightkiln
