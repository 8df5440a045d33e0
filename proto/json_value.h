#pragma once

// JSON text as a value, read strictly: what is ambiguous in JSON is refused here, so that nothing
// above needs to guess. The reader (json_reader.cpp) is the only user of nlohmann-json, of which it
// takes the tokeniser alone; values of ours have no recursion deeper than the limit.

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/bake/spec.h"
#include "core/base/error.h"

namespace lightkiln {

struct JsonMember;

class JsonValue {
 public:
  using Array = std::vector<JsonValue>;
  using Object = std::vector<JsonMember>;  // in the order written; no key twice

  JsonValue() = default;
  explicit JsonValue(bool value) : data_(value) {}
  explicit JsonValue(int64_t value) : data_(value) {}
  explicit JsonValue(uint64_t value) : data_(value) {}
  explicit JsonValue(double value) : data_(value) {}
  explicit JsonValue(std::string value) : data_(std::move(value)) {}
  explicit JsonValue(Array value) : data_(std::move(value)) {}
  explicit JsonValue(Object value) : data_(std::move(value)) {}

  bool is_null() const { return std::holds_alternative<std::monostate>(data_); }
  // Null pointers where the value is of another type.
  const bool* boolean() const { return std::get_if<bool>(&data_); }
  const std::string* string() const { return std::get_if<std::string>(&data_); }
  const Array* array() const { return std::get_if<Array>(&data_); }
  const Object* object() const { return std::get_if<Object>(&data_); }
  Array* array() { return std::get_if<Array>(&data_); }
  Object* object() { return std::get_if<Object>(&data_); }

  bool is_number() const;
  // Of a number: as the nearest double.
  double number() const;
  // Whole numbers written without fraction or exponent; false when the value is anything else or
  // does not fit.
  bool to_unsigned(uint64_t* out) const;
  bool to_signed(int64_t* out) const;

  // Member of an object by key; null when there is none or this is no object.
  const JsonValue* find(std::string_view key) const;

  // "a number", "text", "an object", ... for sentences about faults.
  const char* type_name() const;

 private:
  friend class JsonWriter;
  std::variant<std::monostate, bool, int64_t, uint64_t, double, std::string, Array, Object> data_;
};

struct JsonMember {
  std::string key;
  JsonValue value;
};

struct JsonLimits {
  size_t max_bytes = 1 << 20;
  int max_depth = 32;  // of arrays and objects within each other
};

// Reads one JSON text. Refused: anything that is not JSON (RFC 8259) in valid UTF-8, trailing
// bytes, more depth or bytes than the limits, a key twice in one object, numbers beyond the range
// of a double, and numbers other than zero that a double would hold as zero. On refusal the result
// is null and `fault` says what and where (code "syntax", "duplicate", "range" or "too_large").
JsonValue read_json(std::string_view text, const JsonLimits& limits,
                    std::vector<SpecFault>* faults);

// For texts that this program wrote itself or got from a server: throws Error{code} instead, naming
// `what` ("The plan").
JsonValue read_trusted_json(std::string_view text, ErrorCode code, const std::string& what);

// RFC 6901: "~" and "/" of a key escaped.
std::string json_pointer_token(std::string_view key);

}  // namespace lightkiln
