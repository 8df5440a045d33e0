#include "server/store/event_json.h"

#include <charconv>
#include <cmath>

namespace lightkiln {

namespace {

// RFC 8259, section 7: quotation mark, backslash and everything below U+0020 must be escaped.
void append_quoted(std::string& json, std::string_view text) {
  json += '"';
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      json += '\\';
      json += c;
    } else if (byte < 0x20) {
      json += "\\u00";
      json += "0123456789abcdef"[byte >> 4];
      json += "0123456789abcdef"[byte & 15];
    } else {
      json += c;
    }
  }
  json += '"';
}

}  // namespace

void EventJson::key(std::string_view name) {
  if (json_.size() > 1) json_ += ',';
  append_quoted(json_, name);
  json_ += ':';
}

EventJson& EventJson::text(std::string_view name, std::string_view value) {
  key(name);
  append_quoted(json_, value);
  return *this;
}

EventJson& EventJson::number(std::string_view name, double value) {
  key(name);
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  json_ += std::isfinite(value) ? std::string_view(digits, end) : std::string_view("null");
  return *this;
}

EventJson& EventJson::count(std::string_view name, uint64_t value) {
  key(name);
  json_ += std::to_string(value);
  return *this;
}

std::string EventJson::take() {
  return json_ + "}";
}

}  // namespace lightkiln
