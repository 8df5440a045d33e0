#pragma once

// JSON text, written front to back. Numbers are the shortest digits that read back to the same
// double; text that is not UTF-8 is written with U+FFFD in place of what is broken. There is no way
// to write a NaN: Error{internal} names the member instead.

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/base/math.h"
#include "proto/json_value.h"

namespace lightkiln {

class JsonWriter {
 public:
  JsonWriter& begin_object();
  JsonWriter& end_object();
  JsonWriter& begin_array();
  JsonWriter& end_array();
  JsonWriter& key(std::string_view name);

  JsonWriter& null();
  JsonWriter& value(bool flag);
  JsonWriter& value(double number);  // finite
  JsonWriter& value(std::string_view text);
  JsonWriter& value(const char* text) { return value(std::string_view(text)); }
  template <typename T>
  requires(std::is_integral_v<T> && !std::is_same_v<T, bool>) JsonWriter& value(T number) {
    return raw(std::to_string(number));
  }
  JsonWriter& value(const Vec3d& v);  // [x, y, z]
  JsonWriter& value(const std::vector<std::string>& texts);
  // A value read before; `sorted` writes members in the order of their keys' bytes.
  JsonWriter& value(const JsonValue& json, bool sorted = false);
  // JSON text that is known to be well formed.
  JsonWriter& raw(std::string_view json);

  template <typename T>
  JsonWriter& member(std::string_view name, const T& content) {
    return key(name).value(content);
  }

  std::string take() { return std::move(text_); }

 private:
  void separate();

  std::string text_;
  std::string last_key_;
  bool comma_ = false;  // a value stands before in this array or object
};

// The shortest decimal that reads back to exactly `number`; -0 is "-0.0". Finite numbers only.
std::string json_number(double number);
// With quotes.
std::string json_string(std::string_view text);

}  // namespace lightkiln
