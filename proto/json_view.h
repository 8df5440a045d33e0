#pragma once

// Typed reading of a document that this program or a server wrote: the first member that is missing
// or of another type throws. Unknown members are ignored.

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "proto/json_value.h"

namespace lightkiln {

class JsonView {
 public:
  // `what` names the document in sentences: "The plan". Keeps references.
  JsonView(const JsonValue& value, ErrorCode code, const std::string& what)
      : value_(&value), code_(code), what_(&what) {}

  const JsonValue& json() const { return *value_; }
  bool is_null() const { return value_->is_null(); }
  bool has(std::string_view key) const { return value_->find(key) != nullptr; }

  JsonView at(std::string_view key) const;   // a member that must exist
  const JsonValue::Array& items() const;     // of a list
  const JsonValue::Object& members() const;  // of an object
  JsonView view(const JsonValue& part) const { return JsonView(part, code_, *what_); }

  std::string text() const;
  double number() const;
  bool boolean() const;
  uint64_t count() const;  // a whole number, 0 or more
  int integer() const;     // a whole number that an int holds

  std::string text(std::string_view key) const { return at(key).text(); }
  double number(std::string_view key) const { return at(key).number(); }
  bool boolean(std::string_view key) const { return at(key).boolean(); }
  uint64_t count(std::string_view key) const { return at(key).count(); }
  int integer(std::string_view key) const { return at(key).integer(); }

 private:
  [[noreturn]] void refuse(const std::string& wanted) const;

  const JsonValue* value_;
  ErrorCode code_;
  const std::string* what_;
};

}  // namespace lightkiln
