// GET /v1/kinds: the field tables as a document.

#include "proto/json_writer.h"
#include "proto/messages.h"
#include "proto/spec_table.h"

namespace lightkiln {
namespace {

struct TypeOf {
  const char* operator()(double& (*)(Spec&)) const { return "number"; }
  const char* operator()(std::optional<double>& (*)(Spec&)) const { return "number"; }
  const char* operator()(std::vector<Vec3d>& (*)(Spec&)) const { return "positions"; }
  const char* operator()(const NameMember&) const { return "string"; }
  const char* operator()(const NameSetMember&) const { return "names"; }
  const char* operator()(const NumbersMember&) const { return "numbers"; }
  const char* operator()(bool& (*)(Spec&)) const { return "boolean"; }
  template <typename Whole>
  const char* operator()(Whole& (*)(Spec&)) const {
    return "integer";
  }
};

struct IsOptional {
  template <typename T>
  bool operator()(std::optional<T>& (*)(Spec&)) const {
    return true;
  }
  template <typename T>
  bool operator()(const T&) const {
    return false;
  }
};

struct WriteDefault {
  JsonWriter& writer;
  Spec& spec;

  void operator()(std::vector<Vec3d>& (*)(Spec&)) const { writer.null(); }
  void operator()(const NameMember& member) const { writer.value(member.names[member.get(spec)]); }
  void operator()(const NameSetMember& member) const {
    writer.begin_array();
    for (size_t i = 0; i < member.names.size(); ++i)
      if (member.bits(spec) >> i & 1) writer.value(member.names[i]);
    writer.end_array();
  }
  void operator()(const NumbersMember& member) const {
    writer.begin_array();
    for (const double number : member.list(spec)) writer.value(number);
    writer.end_array();
  }
  template <typename T>
  void operator()(std::optional<T>& (*member)(Spec&)) const {
    if (member(spec))
      writer.value(*member(spec));
    else
      writer.null();
  }
  template <typename T>
  void operator()(T& (*member)(Spec&)) const {
    writer.value(member(spec));
  }
};

void write_names(JsonWriter& writer, const std::vector<std::string_view>& names) {
  writer.key("values").begin_array();
  for (const std::string_view name : names) writer.value(name);
  writer.end_array();
}

void write_range(JsonWriter& writer, const ParameterRow& row) {
  if (const auto* one = std::get_if<NameMember>(&row.member))
    return write_names(writer, one->names);
  if (const auto* some = std::get_if<NameSetMember>(&row.member))
    return write_names(writer, some->names);
  if (const auto* numbers = std::get_if<NumbersMember>(&row.member))
    writer.member("min_items", numbers->least).member("max_items", numbers->most);
  if (row.range.minimum > -1e300)
    writer.member(row.range.exclusive_minimum ? "exclusive_minimum" : "minimum", row.range.minimum);
  if (row.range.maximum < 1e300) writer.member("maximum", row.range.maximum);
}

void write_kind(JsonWriter& writer, const KindTable& table) {
  writer.begin_object()
      .member("kind", kind_name(table.kind))
      .member("title", table.title)
      .key("inputs")
      .begin_array();
  for (const InputRow& input : table.inputs)
    writer.begin_object()
        .member("name", input.name)
        .member("required", input.required)
        .end_object();
  writer.end_array()
      .member("default_target_error", default_target_error(table.kind))
      .key("parameters")
      .begin_array();
  Spec spec = empty_spec(table.kind);
  for (const ParameterGroup& group : table.groups) {
    if (group.create) group.create(spec);
    for (const ParameterRow& row : group.rows) {
      if (row.refused) continue;
      writer.begin_object()
          .member("pointer", std::string(group.path) + "/" + std::string(row.name))
          .member("type", std::visit(TypeOf{}, row.member))
          .member("required", row.required)
          .member("nullable", std::visit(IsOptional{}, row.member))
          .key("default");
      std::visit(WriteDefault{writer, spec}, row.member);
      write_range(writer, row);
      writer.member("description", row.meaning).end_object();
    }
  }
  writer.end_array().end_object();
}

}  // namespace

std::string write_kinds() {
  JsonWriter writer;
  writer.begin_object().key("items").begin_array();
  for (const Kind kind : kKinds) write_kind(writer, kind_table(kind));
  writer.end_array().end_object();
  return writer.take();
}

}  // namespace lightkiln
