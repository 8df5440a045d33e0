#pragma once

// One row a parameter: its place in a spec, its member, its range. Reading, writing, GET /v1/kinds
// and the test that holds openapi.json to core/bake/spec.h all walk these tables. Defaults are
// those of spec.h itself: a row never repeats them.

#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "core/bake/spec.h"

namespace lightkiln {

// The parameters of a spec whose kind is known.
template <typename T>
T& parameters(Spec& spec) {
  return std::get<T>(spec.parameters);
}
template <typename T>
const T& parameters(const Spec& spec) {
  return std::get<T>(spec.parameters);
}

// A member of one of the enumerations, by position in `names`.
struct NameMember {
  std::vector<std::string_view> names;
  size_t (*get)(const Spec& spec);
  void (*set)(Spec& spec, size_t index);
};
// A set of members of an enumeration, each at most once; bit i stands for names[i]. Its spelling is
// a list, written in the order of `names`.
struct NameSetMember {
  std::vector<std::string_view> names;
  uint32_t& (*bits)(Spec& spec);
};
// A list of numbers: the row's range bounds each of them, these how many there are.
struct NumbersMember {
  std::vector<double>& (*list)(Spec& spec);
  size_t least, most;
};
// How a row reaches its member. The spec is of the row's kind and has the row's group. An optional
// member takes null.
using Member =
    std::variant<double& (*)(Spec&), std::optional<double>& (*)(Spec&), int& (*)(Spec&),
                 std::optional<int>& (*)(Spec&), uint64_t& (*)(Spec&),
                 std::optional<uint64_t>& (*)(Spec&), bool& (*)(Spec&),
                 std::vector<Vec3d>& (*)(Spec&), NumbersMember, NameMember, NameSetMember>;

struct Range {
  double minimum = -1e300;
  double maximum = 1e300;
  bool exclusive_minimum = false;  // `minimum` itself is refused
};

struct ParameterRow {
  std::string_view name;  // key in the group's object
  Member member;
  Range range;  // of numbers; of positions: how many
  bool required = false;
  std::string_view meaning;  // for clients: unit, what null means, what raising it costs
  // The kind has no use for it: it is read only so that validate() can say why a value is refused,
  // and neither stands in a canonical spec nor is told to clients.
  bool refused = false;
};

// An object of a spec that holds parameters.
struct ParameterGroup {
  std::string_view path;  // "" | "/parameters" | "/parameters/sh" | "/accuracy"
  std::vector<ParameterRow> rows;
  // For groups that are ordered by standing there; null for the others.
  bool (*present)(const Spec& spec) = nullptr;
  void (*create)(Spec& spec) = nullptr;
};

struct InputRow {
  std::string_view name;
  std::optional<InputRef> Spec::*member;
  bool required;
  bool image;  // of light: one file or six faces; else a scene, which may have resources
};

struct KindTable {
  Kind kind;
  std::string_view title;
  std::vector<InputRow> inputs;
  std::vector<ParameterGroup> groups;  // parents before children
};

const KindTable& kind_table(Kind kind);

// A spec of this kind with every default and no inputs.
Spec empty_spec(Kind kind);

}  // namespace lightkiln
