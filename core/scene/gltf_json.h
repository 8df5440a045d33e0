#pragma once

// A JSON tree that can be checked before it is trusted, edited, and written back byte for byte the
// same way each time. Members keep the file's order; numbers are doubles, which every value that
// glTF allows fits.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace lightkiln {

// A namespace of its own: proto has a JsonValue too, and one program links both.
namespace gltf_json {

struct JsonValue;
struct JsonMember;
using JsonArray = std::vector<JsonValue>;
using JsonObject = std::vector<JsonMember>;

struct JsonValue {
  std::variant<std::nullptr_t, bool, double, std::string, JsonArray, JsonObject> data = nullptr;

  const JsonObject* object() const { return std::get_if<JsonObject>(&data); }
  JsonObject* object() { return std::get_if<JsonObject>(&data); }
  const JsonArray* array() const { return std::get_if<JsonArray>(&data); }
  JsonArray* array() { return std::get_if<JsonArray>(&data); }

  // The member, or nullptr when this is no object or has none of that name.
  const JsonValue* find(std::string_view key) const;
  JsonValue* find(std::string_view key);
  // Replaces or appends a member; a null becomes an object first.
  JsonValue& set(std::string_view key, JsonValue value);
  void erase(std::string_view key);
};

struct JsonMember {
  std::string key;
  JsonValue value;
};

}  // namespace gltf_json
using gltf_json::JsonArray;
using gltf_json::JsonMember;
using gltf_json::JsonObject;
using gltf_json::JsonValue;

JsonValue json_number(double value);
JsonValue json_string(std::string value);

// Compact text: shortest digits that read back as the same double, members in their order.
std::string to_text(const JsonValue& value);

// `where` continued by one key, "~" and "/" escaped (RFC 6901).
std::string pointer_below(const std::string& where, std::string_view key);

// A value and its place (a JSON pointer, RFC 6901). Every getter throws Error{invalid_input} that
// names the place when the value is of another kind or out of range.
class JsonAt {
 public:
  JsonAt(const JsonValue& value, std::string where) : value_(&value), where_(std::move(where)) {}

  const JsonValue& value() const { return *value_; }
  const std::string& where() const { return where_; }

  std::optional<JsonAt> find(std::string_view key) const;  // this must be an object
  JsonAt at(std::string_view key) const;                   // the member must be there
  size_t size() const;                                     // this must be an array
  JsonAt operator[](size_t index) const;

  void expect_object() const;
  double number() const;
  uint64_t integer(uint64_t low, uint64_t high) const;
  bool boolean() const;
  const std::string& string() const;

  // For members that may be absent.
  uint64_t integer_or(std::string_view key, uint64_t fallback, uint64_t low, uint64_t high) const;

  [[noreturn]] void fail(const std::string& sentence) const;

 private:
  const JsonValue* value_;
  std::string where_;
};

}  // namespace lightkiln
