// The tokeniser of nlohmann-json feeding our own values. Its DOM is not used: it keeps the last of
// two equal keys, converts numbers unchecked, and copies and destroys by recursion.

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "proto/json_value.h"

namespace lightkiln {
namespace {

class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit Builder(int max_depth) : max_depth_(max_depth) {}

  bool null() override { return add(JsonValue()); }
  bool boolean(bool value) override { return add(JsonValue(value)); }
  bool number_integer(number_integer_t value) override { return add(JsonValue(int64_t{value})); }
  bool number_unsigned(number_unsigned_t value) override { return add(JsonValue(uint64_t{value})); }
  bool number_float(number_float_t value, const string_t& text) override {
    if (value == 0 && text.find_first_of("123456789") < text.find_first_of("eE"))
      return refuse("range", "The number " + text.substr(0, 40) + " is too small to be held.");
    return add(JsonValue(value));
  }
  bool string(string_t& value) override { return add(JsonValue(std::move(value))); }
  bool binary(binary_t&) override { return refuse("syntax", "Binary values are not JSON."); }

  bool start_object(size_t) override { return open(JsonValue(JsonValue::Object{})); }
  bool key(string_t& value) override {
    open_.back().key = std::move(value);
    return true;
  }
  bool end_object() override {
    const JsonValue::Object& members = *open_.back().value.object();
    std::vector<const std::string*> keys;
    keys.reserve(members.size());
    for (const JsonMember& member : members) keys.push_back(&member.key);
    std::sort(keys.begin(), keys.end(), [](auto* a, auto* b) { return *a < *b; });
    const auto twice =
        std::adjacent_find(keys.begin(), keys.end(), [](auto* a, auto* b) { return *a == *b; });
    if (twice != keys.end()) {
      open_.back().key = **twice;
      return refuse("duplicate", "The key \"" + **twice + "\" stands twice in one object.");
    }
    return close();
  }
  bool start_array(size_t) override { return open(JsonValue(JsonValue::Array{})); }
  bool end_array() override { return close(); }

  bool parse_error(size_t position, const std::string&,
                   const nlohmann::json::exception& error) override {
    const bool overflow = error.id == 406;  // out_of_range.406: number overflow
    fault_ = overflow ? SpecFault{pointer(), "range", "A number is too large to be held."}
                      : SpecFault{"", "syntax",
                                  "This is not JSON: unexpected input near byte " +
                                      std::to_string(position) + "."};
    return false;
  }

  JsonValue take() { return std::move(root_); }
  const SpecFault& fault() const { return fault_; }

 private:
  struct Level {
    JsonValue value;
    std::string key;  // of the member that is being read, when the value is an object
  };

  bool add(JsonValue value) {
    if (open_.empty())
      root_ = std::move(value);
    else if (JsonValue::Array* items = open_.back().value.array())
      items->push_back(std::move(value));
    else
      open_.back().value.object()->push_back({open_.back().key, std::move(value)});
    return true;
  }

  bool open(JsonValue value) {
    if (open_.size() == static_cast<size_t>(max_depth_)) {
      fault_ = {pointer(), "too_large",
                "The document nests deeper than " + std::to_string(max_depth_) + " levels."};
      return false;
    }
    open_.push_back({std::move(value), ""});
    return true;
  }

  bool close() {
    JsonValue value = std::move(open_.back().value);
    open_.pop_back();
    return add(std::move(value));
  }

  bool refuse(const char* code, const std::string& message) {
    fault_ = {pointer(), code, message};
    return false;
  }

  std::string pointer() const {
    std::string path;
    for (const Level& level : open_) {
      const JsonValue::Array* items = level.value.array();
      path += '/';
      path += items ? std::to_string(items->size()) : json_pointer_token(level.key);
    }
    return path;
  }

  int max_depth_;
  JsonValue root_;
  std::vector<Level> open_;
  SpecFault fault_;
};

}  // namespace

JsonValue read_json(std::string_view text, const JsonLimits& limits,
                    std::vector<SpecFault>* faults) {
  if (text.size() > limits.max_bytes) {
    faults->push_back({"", "too_large",
                       "The document has " + std::to_string(text.size()) + " bytes; at most " +
                           std::to_string(limits.max_bytes) + " are read."});
    return JsonValue();
  }
  // A byte-order mark is not JSON (RFC 8259, section 8.1); the tokeniser would skip it.
  if (text.starts_with("\xEF\xBB\xBF")) {
    faults->push_back({"", "syntax", "This is not JSON: it starts with a byte-order mark."});
    return JsonValue();
  }
  // The tokeniser takes a NUL for the end of the input and would not see what follows.
  const size_t nul = text.find('\0');
  if (nul != std::string_view::npos) {
    faults->push_back(
        {"", "syntax", "This is not JSON: byte " + std::to_string(nul) + " is a NUL."});
    return JsonValue();
  }
  Builder builder(limits.max_depth);
  if (nlohmann::json::sax_parse(text.begin(), text.end(), &builder)) return builder.take();
  faults->push_back(builder.fault());
  return JsonValue();
}

JsonValue read_trusted_json(std::string_view text, ErrorCode code, const std::string& what) {
  std::vector<SpecFault> faults;
  JsonValue value = read_json(text, JsonLimits{size_t{1} << 30, 64}, &faults);
  if (!faults.empty()) throw Error(code, what + " cannot be read: " + faults[0].message);
  return value;
}

}  // namespace lightkiln
