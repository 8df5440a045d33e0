#include "core/scene/gltf_json.h"

#include <charconv>
#include <cmath>

#include "core/base/error.h"

namespace lightkiln {

// --- The tree ------------------------------------------------------------------------------------

const JsonValue* JsonValue::find(std::string_view key) const {
  if (const JsonObject* members = object()) {
    for (const JsonMember& member : *members) {
      if (member.key == key) return &member.value;
    }
  }
  return nullptr;
}

JsonValue* JsonValue::find(std::string_view key) {
  return const_cast<JsonValue*>(std::as_const(*this).find(key));
}

JsonValue& JsonValue::set(std::string_view key, JsonValue value) {
  if (!object()) data = JsonObject{};
  if (JsonValue* old = find(key)) return *old = std::move(value);
  return object()->emplace_back(JsonMember{std::string(key), std::move(value)}).value;
}

void JsonValue::erase(std::string_view key) {
  if (JsonObject* members = object()) {
    std::erase_if(*members, [&](const JsonMember& member) { return member.key == key; });
  }
}

JsonValue json_number(double value) {
  return {value};
}
JsonValue json_string(std::string value) {
  return {std::move(value)};
}

// --- Writing -------------------------------------------------------------------------------------

static void append_string(std::string& text, const std::string& value) {
  static constexpr char kHex[] = "0123456789abcdef";
  text += '"';
  for (const char c : value) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (byte < 0x20) {
      text += "\\u00";
      text += kHex[byte >> 4];
      text += kHex[byte & 15];
    } else {
      text += c;
    }
  }
  text += '"';
}

static void append_number(std::string& text, double value) {
  char digits[32];
  // Whole numbers are written without exponent, as glTF's readers expect of counts and indices.
  const bool whole = std::floor(value) == value && std::abs(value) < 0x1p53;
  const auto end = whole
                       ? std::to_chars(digits, digits + sizeof digits, static_cast<int64_t>(value))
                       : std::to_chars(digits, digits + sizeof digits, value);
  text.append(digits, end.ptr);
}

static void append(std::string& text, const JsonValue& value) {
  if (const bool* boolean = std::get_if<bool>(&value.data)) {
    text += *boolean ? "true" : "false";
  } else if (const double* number = std::get_if<double>(&value.data)) {
    append_number(text, *number);
  } else if (const std::string* string = std::get_if<std::string>(&value.data)) {
    append_string(text, *string);
  } else if (const JsonArray* items = value.array()) {
    text += '[';
    for (size_t i = 0; i < items->size(); ++i) {
      if (i != 0) text += ',';
      append(text, (*items)[i]);
    }
    text += ']';
  } else if (const JsonObject* members = value.object()) {
    text += '{';
    for (size_t i = 0; i < members->size(); ++i) {
      if (i != 0) text += ',';
      append_string(text, (*members)[i].key);
      text += ':';
      append(text, (*members)[i].value);
    }
    text += '}';
  } else {
    text += "null";
  }
}

std::string to_text(const JsonValue& value) {
  std::string text;
  append(text, value);
  return text;
}

// --- Checked reading -----------------------------------------------------------------------------

std::string pointer_below(const std::string& where, std::string_view key) {
  std::string path = where + "/";
  for (const char c : key) {
    if (c == '~') {
      path += "~0";
    } else if (c == '/') {
      path += "~1";
    } else {
      path += c;
    }
  }
  return path;
}

void JsonAt::fail(const std::string& sentence) const {
  throw Error(ErrorCode::invalid_input, sentence, where_);
}

void JsonAt::expect_object() const {
  if (!value_->object()) fail("This part of the glTF must be an object.");
}

std::optional<JsonAt> JsonAt::find(std::string_view key) const {
  expect_object();
  if (const JsonValue* member = value_->find(key))
    return JsonAt(*member, pointer_below(where_, key));
  return std::nullopt;
}

JsonAt JsonAt::at(std::string_view key) const {
  if (auto member = find(key)) return *member;
  fail("The glTF lacks the required property '" + std::string(key) + "' here.");
}

size_t JsonAt::size() const {
  const JsonArray* items = value_->array();
  if (!items) fail("This part of the glTF must be an array.");
  return items->size();
}

JsonAt JsonAt::operator[](size_t index) const {
  return JsonAt((*value_->array())[index], where_ + "/" + std::to_string(index));
}

double JsonAt::number() const {
  const double* number = std::get_if<double>(&value_->data);
  if (!number) fail("This part of the glTF must be a number.");
  return *number;
}

uint64_t JsonAt::integer(uint64_t low, uint64_t high) const {
  const double value = number();
  // 2^53 bounds what a double holds exactly; every limit asked for here lies below it.
  if (!(value >= 0 && value < 0x1p53) || std::floor(value) != value ||
      static_cast<uint64_t>(value) < low || static_cast<uint64_t>(value) > high) {
    fail("This part of the glTF must be a whole number from " + std::to_string(low) + " to " +
         std::to_string(high) + ".");
  }
  return static_cast<uint64_t>(value);
}

bool JsonAt::boolean() const {
  const bool* boolean = std::get_if<bool>(&value_->data);
  if (!boolean) fail("This part of the glTF must be true or false.");
  return *boolean;
}

const std::string& JsonAt::string() const {
  const std::string* string = std::get_if<std::string>(&value_->data);
  if (!string) fail("This part of the glTF must be a string.");
  return *string;
}

uint64_t JsonAt::integer_or(std::string_view key, uint64_t fallback, uint64_t low,
                            uint64_t high) const {
  const auto member = find(key);
  return member ? member->integer(low, high) : fallback;
}

}  // namespace lightkiln
