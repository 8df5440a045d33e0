#include "proto/json_value.h"

namespace lightkiln {

bool JsonValue::is_number() const {
  return std::holds_alternative<int64_t>(data_) || std::holds_alternative<uint64_t>(data_) ||
         std::holds_alternative<double>(data_);
}

double JsonValue::number() const {
  if (const auto* value = std::get_if<int64_t>(&data_)) return static_cast<double>(*value);
  if (const auto* value = std::get_if<uint64_t>(&data_)) return static_cast<double>(*value);
  return std::get<double>(data_);
}

bool JsonValue::to_unsigned(uint64_t* out) const {
  const auto* value = std::get_if<uint64_t>(&data_);
  if (value) *out = *value;
  return value != nullptr;
}

bool JsonValue::to_signed(int64_t* out) const {
  if (const auto* value = std::get_if<int64_t>(&data_)) {
    *out = *value;
    return true;
  }
  const auto* value = std::get_if<uint64_t>(&data_);
  if (!value || *value > static_cast<uint64_t>(INT64_MAX)) return false;
  *out = static_cast<int64_t>(*value);
  return true;
}

const JsonValue* JsonValue::find(std::string_view key) const {
  const Object* members = object();
  if (!members) return nullptr;
  for (const JsonMember& member : *members)
    if (member.key == key) return &member.value;
  return nullptr;
}

const char* JsonValue::type_name() const {
  if (is_null()) return "null";
  if (boolean()) return "true or false";
  if (string()) return "text";
  if (array()) return "a list";
  if (object()) return "an object";
  return "a number";
}

std::string json_pointer_token(std::string_view key) {
  std::string token;
  for (const char c : key) {
    if (c == '~')
      token += "~0";
    else if (c == '/')
      token += "~1";
    else
      token += c;
  }
  return token;
}

}  // namespace lightkiln
