#pragma once

// Collecting what is wrong with a client's document, all at once.

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/json_value.h"

namespace lightkiln {

class FaultList {
 public:
  static constexpr size_t kMaxFaults = 100;  // more of them are counted in one last entry

  void add(SpecFault fault);
  bool empty() const { return faults_.empty(); }
  // Whether a fault was told at this pointer, above it or below it.
  bool concerns(std::string_view pointer) const;
  const std::vector<SpecFault>& told() const { return faults_; }
  std::vector<SpecFault> take();

 private:
  std::vector<SpecFault> faults_;
  size_t untold_ = 0;
};

// A value of a client's document with its place.
struct JsonPlace {
  const JsonValue* value;
  std::string pointer;
  FaultList* faults;

  JsonPlace child(std::string_view key, const JsonValue& part) const;
  void refuse(const char* code, const std::string& message, const std::string& allowed = "") const;
  // "must be X; it is Y".
  void refuse_type(const std::string& allowed) const;
};

// False, with a fault, when the value is no object. Otherwise tells every member that is not in
// `known`, with the nearest known name.
bool read_object(const JsonPlace& place, std::span<const std::string_view> known);

// The known name that is nearest by edit distance (Levenshtein 1966), when at most a third of the
// longer name must change; "" otherwise.
std::string nearest_name(std::string_view name, std::span<const std::string_view> known);

// "a, b or c"
std::string join_names(std::span<const std::string_view> names);

}  // namespace lightkiln
