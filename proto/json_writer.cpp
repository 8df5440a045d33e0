#include "proto/json_writer.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/base/error.h"

namespace lightkiln {
namespace {

// The length of the well-formed UTF-8 sequence at the front (Unicode 15, table 3-7), 0 when there
// is none.
size_t utf8_length(std::string_view text) {
  const auto byte = [&](size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  const auto tail = [&](size_t i) { return (byte(i) & 0xC0u) == 0x80u; };
  const unsigned lead = byte(0), second = byte(1);
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) return tail(1) ? 2 : 0;
  if (lead >= 0xE0 && lead <= 0xEF) {
    const bool overlong = lead == 0xE0 && second < 0xA0;
    const bool surrogate = lead == 0xED && second > 0x9F;
    return tail(1) && tail(2) && !overlong && !surrogate ? 3 : 0;
  }
  if (lead >= 0xF0 && lead <= 0xF4) {
    const bool overlong = lead == 0xF0 && second < 0x90;
    const bool beyond = lead == 0xF4 && second > 0x8F;
    return tail(1) && tail(2) && tail(3) && !overlong && !beyond ? 4 : 0;
  }
  return 0;
}

void append_escaped(std::string* out, unsigned char c) {
  static constexpr char kHex[] = "0123456789abcdef";
  switch (c) {
    case '"':
      *out += "\\\"";
      return;
    case '\\':
      *out += "\\\\";
      return;
    case '\n':
      *out += "\\n";
      return;
    case '\r':
      *out += "\\r";
      return;
    case '\t':
      *out += "\\t";
      return;
    default:
      *out += "\\u00";
      *out += kHex[c >> 4];
      *out += kHex[c & 15];
  }
}

}  // namespace

std::string json_number(double number) {
  if (number == 0) return std::signbit(number) ? "-0.0" : "0";
  char digits[32];
  const auto [end, error] = std::to_chars(digits, digits + sizeof digits, number);
  return std::string(digits, end);
}

std::string json_string(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const size_t length = utf8_length(text);
    const auto c = static_cast<unsigned char>(text[0]);
    if (length == 0)
      out += "\xEF\xBF\xBD";
    else if (length == 1 && (c < 0x20 || c == 0x7F || c == '"' || c == '\\'))
      append_escaped(&out, c);
    else
      out += text.substr(0, length);
    text.remove_prefix(std::max<size_t>(length, 1));
  }
  return out + "\"";
}

void JsonWriter::separate() {
  if (comma_) text_ += ',';
  comma_ = true;
}

JsonWriter& JsonWriter::begin_object() {
  separate();
  text_ += '{';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::end_object() {
  text_ += '}';
  comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::begin_array() {
  separate();
  text_ += '[';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::end_array() {
  text_ += ']';
  comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::key(std::string_view name) {
  separate();
  text_ += json_string(name);
  text_ += ':';
  comma_ = false;
  last_key_ = name;
  return *this;
}

JsonWriter& JsonWriter::raw(std::string_view json) {
  separate();
  text_ += json;
  return *this;
}

JsonWriter& JsonWriter::null() {
  return raw("null");
}

JsonWriter& JsonWriter::value(bool flag) {
  return raw(flag ? "true" : "false");
}

JsonWriter& JsonWriter::value(double number) {
  if (!std::isfinite(number))
    throw Error(ErrorCode::internal, "The member \"" + last_key_ + "\" of a document is " +
                                         std::to_string(number) + "; it must be finite.");
  return raw(json_number(number));
}

JsonWriter& JsonWriter::value(std::string_view text) {
  return raw(json_string(text));
}

JsonWriter& JsonWriter::value(const Vec3d& v) {
  return begin_array().value(v.x).value(v.y).value(v.z).end_array();
}

JsonWriter& JsonWriter::value(const std::vector<std::string>& texts) {
  begin_array();
  for (const std::string& text : texts) value(text);
  return end_array();
}

JsonWriter& JsonWriter::value(const JsonValue& json, bool sorted) {
  if (json.is_null()) return null();
  if (json.boolean()) return value(*json.boolean());
  if (json.string()) return value(*json.string());
  if (const JsonValue::Array* items = json.array()) {
    begin_array();
    for (const JsonValue& item : *items) value(item, sorted);
    return end_array();
  }
  if (const JsonValue::Object* object = json.object()) {
    std::vector<const JsonMember*> members;
    for (const JsonMember& member : *object) members.push_back(&member);
    if (sorted)
      std::sort(members.begin(), members.end(),
                [](const auto* a, const auto* b) { return a->key < b->key; });
    begin_object();
    for (const JsonMember* member : members) key(member->key).value(member->value, sorted);
    return end_object();
  }
  if (const auto* number = std::get_if<int64_t>(&json.data_)) return value(*number);
  if (const auto* number = std::get_if<uint64_t>(&json.data_)) return value(*number);
  return value(std::get<double>(json.data_));
}

}  // namespace lightkiln
