// Reading specs by the tables of spec_table.cpp.

#include "proto/spec_json.h"

#include <algorithm>
#include <cmath>

#include "proto/json.h"
#include "proto/json_writer.h"
#include "proto/spec_inputs.h"
#include "proto/spec_table.h"

namespace lightkiln {
namespace {

std::string range_text(const Range& range, const char* what) {
  std::string text = what;
  const bool bounded = range.maximum < 1e300;
  const std::string top = bounded ? json_number(range.maximum) : "";
  if (range.exclusive_minimum)
    text += " above " + json_number(range.minimum) + (bounded ? ", at most " + top : "");
  else if (range.minimum > -1e300)
    text += bounded ? " from " + json_number(range.minimum) + " to " + top
                    : " of at least " + json_number(range.minimum);
  return text;
}

bool in_range(const Range& range, double value) {
  const bool above = range.exclusive_minimum ? value > range.minimum : value >= range.minimum;
  return above && value <= range.maximum;
}

// One overload a member type gives its name and reads it; false after a fault.

std::string value_text(const Range& range, const double*) {
  return range_text(range, "a number");
}
std::string value_text(const Range& range, const int*) {
  return range_text(range, "a whole number");
}
std::string value_text(const Range& range, const uint64_t*) {
  // The largest 64-bit number as a double would read one too many.
  return range.maximum > 1e19 ? "a whole number from 0 to 18446744073709551615"
                              : range_text(range, "a whole number");
}

bool read_value(const JsonPlace& place, const Range& range, double* out) {
  const std::string allowed = value_text(range, out);
  if (!place.value->is_number()) {
    place.refuse_type(allowed);
    return false;
  }
  const double number = place.value->number();
  if (!in_range(range, number)) {
    place.refuse("range",
                 place.pointer + " must be " + allowed + "; it is " + json_number(number) + ".",
                 allowed);
    return false;
  }
  *out =
      number == 0 ? 0.0 : number;  // one spelling of zero, so that equal specs have equal digests
  return true;
}

template <typename Whole>
bool read_value(const JsonPlace& place, const Range& range, Whole* out) {
  const std::string allowed = value_text(range, out);
  if (!place.value->is_number()) {
    place.refuse_type(allowed);
    return false;
  }
  uint64_t number = 0;
  const bool whole = place.value->to_unsigned(&number);
  if (!whole || !in_range(range, static_cast<double>(number))) {
    const bool fraction = !whole && std::trunc(place.value->number()) != place.value->number();
    place.refuse(fraction ? "type" : "range",
                 place.pointer + " must be " + allowed + "; it is " +
                     (whole ? std::to_string(number) : json_number(place.value->number())) + ".",
                 allowed);
    return false;
  }
  *out = static_cast<Whole>(number);
  return true;
}

bool read_value(const JsonPlace& place, const Range&, bool* out) {
  const bool* value = place.value->boolean();
  if (!value) {
    place.refuse_type("true or false");
    return false;
  }
  *out = *value;
  return true;
}

// The index of a name; none after a fault.
std::optional<size_t> read_name(const JsonPlace& place, std::span<const std::string_view> names,
                                const std::string& allowed) {
  const std::string* name = place.value->string();
  if (!name) {
    place.refuse_type("one of " + allowed);
    return std::nullopt;
  }
  const auto found = std::find(names.begin(), names.end(), *name);
  if (found != names.end()) return static_cast<size_t>(found - names.begin());
  place.faults->add(
      {place.pointer, "range",
       place.pointer + " must be " + allowed + ", not \"" + name->substr(0, 80) + "\".", allowed,
       nearest_name(*name, names)});
  return std::nullopt;
}

void read_position(const JsonPlace& place, std::vector<Vec3d>* out) {
  const JsonValue::Array* numbers = place.value->array();
  if (!numbers || numbers->size() != 3) {
    place.refuse_type("a list of three numbers");
    return;
  }
  Vec3d position;
  bool good = true;
  for (int axis = 0; axis < 3; ++axis)
    good &= read_value(place.child(std::to_string(axis), (*numbers)[static_cast<size_t>(axis)]),
                       Range{-1e18, 1e18}, &position[axis]);
  if (good) out->push_back(position);
}

struct RowReader {
  const JsonPlace& place;
  const ParameterRow& row;
  Spec& spec;

  template <typename T>
  void operator()(T& (*member)(Spec&)) const {
    read_value(place, row.range, &member(spec));
  }
  template <typename T>
  void operator()(std::optional<T>& (*member)(Spec&)) const {
    T number{};
    if (place.value->is_null())
      member(spec).reset();
    else if (read_value(place, row.range, &number))
      member(spec) = number;
  }
  void operator()(std::vector<Vec3d>& (*member)(Spec&)) const {
    const std::string allowed = allowed_values(row);
    const JsonValue::Array* items = place.value->array();
    if (!items) return place.refuse_type(allowed);
    if (!in_range(row.range, static_cast<double>(items->size())))
      return place.refuse(
          "range",
          place.pointer + " must be " + allowed + "; it has " + std::to_string(items->size()) + ".",
          allowed);
    for (size_t i = 0; i < items->size(); ++i)
      read_position(place.child(std::to_string(i), (*items)[i]), &member(spec));
  }
  void operator()(const NumbersMember& member) const {
    const std::string allowed = allowed_values(row);
    const JsonValue::Array* items = place.value->array();
    if (!items) return place.refuse_type(allowed);
    if (items->size() < member.least || items->size() > member.most)
      return place.refuse(
          "range",
          place.pointer + " must be " + allowed + "; it has " + std::to_string(items->size()) + ".",
          allowed);
    std::vector<double> numbers(items->size());
    bool good = true;
    for (size_t i = 0; i < items->size(); ++i)
      good &= read_value(place.child(std::to_string(i), (*items)[i]), row.range, &numbers[i]);
    if (good) member.list(spec) = std::move(numbers);
  }
  void operator()(const NameMember& member) const {
    const std::optional<size_t> index = read_name(place, member.names, allowed_values(row));
    if (index) member.set(spec, *index);
  }
  void operator()(const NameSetMember& member) const {
    const std::string allowed = join_names(member.names);
    const JsonValue::Array* items = place.value->array();
    if (!items) return place.refuse_type(allowed_values(row));
    uint32_t bits = 0;
    for (size_t i = 0; i < items->size(); ++i) {
      const JsonPlace item = place.child(std::to_string(i), (*items)[i]);
      const std::optional<size_t> index = read_name(item, member.names, allowed);
      if (!index) continue;
      const uint32_t bit = 1u << *index;
      if (bits & bit) item.refuse("duplicate", item.pointer + " stands in the list already.", "");
      bits |= bit;
    }
    member.bits(spec) = bits;
  }
};

// The value at a group's path; null where there is none.
const JsonValue* find_group(const JsonValue& root, std::string_view path) {
  const JsonValue* value = &root;
  while (value && !path.empty()) {
    path.remove_prefix(1);
    const std::string_view key = path.substr(0, path.find('/'));
    value = value->find(key);
    path.remove_prefix(key.size());
  }
  return value;
}

std::vector<std::string_view> known_members(const KindTable& table, const ParameterGroup& group) {
  std::vector<std::string_view> known;
  if (group.path.empty()) known = {"kind", "inputs"};
  for (const ParameterRow& row : group.rows) known.push_back(row.name);
  for (const ParameterGroup& other : table.groups) {
    const size_t slash = other.path.rfind('/');
    if (slash != std::string_view::npos && other.path.substr(0, slash) == group.path)
      known.push_back(other.path.substr(slash + 1));
  }
  return known;
}

void read_group(const JsonPlace& root, const KindTable& table, const ParameterGroup& group,
                Spec* spec) {
  const JsonValue* value = find_group(*root.value, group.path);
  const JsonPlace place{value, root.pointer + std::string(group.path), root.faults};
  if (value && !read_object(place, known_members(table, group))) return;
  if (value && group.create) group.create(*spec);
  for (const ParameterRow& row : group.rows) {
    const JsonValue* part = value ? value->find(row.name) : nullptr;
    const std::string pointer = place.pointer + "/" + std::string(row.name);
    if (part)
      std::visit(RowReader{place.child(row.name, *part), row, *spec}, row.member);
    else if (row.required && !place.faults->concerns(pointer))
      place.faults->add({pointer, "missing",
                         pointer + " is missing; it must be " + allowed_values(row) + ".",
                         allowed_values(row), ""});
  }
}

std::string_view parent_of(std::string_view pointer) {
  return pointer.substr(0, pointer.rfind('/'));
}

// Core's own checks see values of which some were refused above and left at their defaults. What
// may only follow from those is not told: a fault in an object where a value was refused.
void add_core_faults(const JsonPlace& root, const Spec& spec) {
  const std::vector<SpecFault> read = root.faults->told();
  for (SpecFault fault : validate(spec)) {
    fault.pointer = root.pointer + fault.pointer;
    const bool follows = std::any_of(read.begin(), read.end(), [&](const SpecFault& earlier) {
      const bool stray = earlier.code == "unknown" && earlier.suggestion.empty();
      return !stray && parent_of(earlier.pointer) == parent_of(fault.pointer);
    });
    if (!follows && !root.faults->concerns(fault.pointer)) root.faults->add(fault);
  }
}

const KindTable* read_kind(const JsonPlace& root) {
  std::vector<std::string_view> names;
  for (const Kind kind : kKinds) names.push_back(kind_name(kind));
  const std::string allowed = join_names(names);
  const JsonValue* value = root.value->find("kind");
  if (!value) {
    root.faults->add({root.pointer + "/kind", "missing",
                      "The kind is missing; it is " + allowed + ".", allowed, ""});
    return nullptr;
  }
  const JsonPlace place = root.child("kind", *value);
  const std::string* name = value->string();
  if (!name) {
    place.refuse_type("one of " + allowed);
    return nullptr;
  }
  for (const Kind kind : kKinds)
    if (*name == kind_name(kind)) return &kind_table(kind);
  root.faults->add(
      {place.pointer, "range",
       "There is no kind \"" + name->substr(0, 80) + "\"; allowed are " + allowed + ".", allowed,
       nearest_name(*name, names)});
  return nullptr;
}

}  // namespace

std::string allowed_values(const ParameterRow& row) {
  struct Text {
    const ParameterRow& row;
    std::string operator()(double& (*)(Spec&)) const {
      return value_text(row.range, static_cast<double*>(nullptr));
    }
    std::string operator()(int& (*)(Spec&)) const {
      return value_text(row.range, static_cast<int*>(nullptr));
    }
    std::string operator()(uint64_t& (*)(Spec&)) const {
      return value_text(row.range, static_cast<uint64_t*>(nullptr));
    }
    std::string operator()(std::optional<double>& (*)(Spec&)) const {
      return value_text(row.range, static_cast<double*>(nullptr)) + ", or null";
    }
    std::string operator()(std::optional<int>& (*)(Spec&)) const {
      return value_text(row.range, static_cast<int*>(nullptr)) + ", or null";
    }
    std::string operator()(std::optional<uint64_t>& (*)(Spec&)) const {
      return value_text(row.range, static_cast<uint64_t*>(nullptr)) + ", or null";
    }
    std::string operator()(std::vector<Vec3d>& (*)(Spec&)) const {
      return "a list of " + json_number(row.range.minimum) + " to " +
             json_number(row.range.maximum) + " positions [x, y, z], each from -1e18 to 1e18";
    }
    std::string operator()(bool& (*)(Spec&)) const { return "true or false"; }
    std::string operator()(const NumbersMember& member) const {
      return "a list of " + std::to_string(member.least) + " to " + std::to_string(member.most) +
             ", each " + value_text(row.range, static_cast<double*>(nullptr));
    }
    std::string operator()(const NameMember& member) const { return join_names(member.names); }
    std::string operator()(const NameSetMember& member) const {
      return "a list of " + join_names(member.names) + ", each at most once";
    }
  };
  return std::visit(Text{row}, row.member);
}

Spec read_spec(const JsonPlace& root) {
  static constexpr std::string_view kRoot[] = {"kind", "inputs", "parameters", "accuracy", "seed"};
  if (!root.value->object()) {
    root.refuse_type("an object");
    return Spec{};
  }
  const KindTable* table = read_kind(root);
  if (!table) {
    read_object(root, kRoot);
    return Spec{};
  }
  Spec spec = empty_spec(table->kind);
  read_inputs(root, *table, &spec);
  for (const ParameterGroup& group : table->groups) read_group(root, *table, group, &spec);
  add_core_faults(root, spec);
  return spec;
}

ParsedSpec parse_spec(std::string_view json) {
  ParsedSpec parsed;
  const JsonValue value = read_json(json, JsonLimits{}, &parsed.faults);
  if (!parsed.faults.empty()) return parsed;
  FaultList faults;
  parsed.spec = read_spec({&value, "", &faults});
  parsed.faults = faults.take();
  return parsed;
}

}  // namespace lightkiln
