// The one spelling of a spec. Its digest names results, so every default is written out and equal
// orders have equal bytes.

#include <algorithm>

#include "proto/digest.h"
#include "proto/json.h"
#include "proto/json_writer.h"
#include "proto/spec_table.h"

namespace lightkiln {
namespace {

struct RowWriter {
  Spec& spec;

  JsonValue operator()(double& (*member)(Spec&)) const { return JsonValue(member(spec)); }
  JsonValue operator()(int& (*member)(Spec&)) const { return JsonValue(int64_t{member(spec)}); }
  JsonValue operator()(uint64_t& (*member)(Spec&)) const { return JsonValue(member(spec)); }
  template <typename T>
  JsonValue operator()(std::optional<T>& (*member)(Spec&)) const {
    const std::optional<T>& held = member(spec);
    if (!held) return JsonValue();
    if constexpr (std::is_same_v<T, int>)
      return JsonValue(int64_t{*held});
    else
      return JsonValue(*held);
  }
  JsonValue operator()(std::vector<Vec3d>& (*member)(Spec&)) const {
    JsonValue::Array positions;
    for (const Vec3d& p : member(spec))
      positions.push_back(
          JsonValue(JsonValue::Array{JsonValue(p.x), JsonValue(p.y), JsonValue(p.z)}));
    return JsonValue(std::move(positions));
  }
  JsonValue operator()(bool& (*member)(Spec&)) const { return JsonValue(member(spec)); }
  JsonValue operator()(const NumbersMember& member) const {
    JsonValue::Array numbers;
    for (const double number : member.list(spec)) numbers.push_back(JsonValue(number));
    return JsonValue(std::move(numbers));
  }
  JsonValue operator()(const NameSetMember& member) const {
    JsonValue::Array names;
    for (size_t i = 0; i < member.names.size(); ++i)
      if (member.bits(spec) >> i & 1) names.push_back(JsonValue(std::string(member.names[i])));
    return JsonValue(std::move(names));
  }
  JsonValue operator()(const NameMember& member) const {
    return JsonValue(std::string(member.names[member.get(spec)]));
  }
};

// The object at `path` below `root`, made where it does not stand yet.
JsonValue::Object& object_at(JsonValue* root, std::string_view path) {
  JsonValue* value = root;
  while (!path.empty()) {
    path.remove_prefix(1);
    const std::string_view key = path.substr(0, path.find('/'));
    path.remove_prefix(key.size());
    JsonValue::Object& members = *value->object();
    const auto found = std::find_if(members.begin(), members.end(),
                                    [&](const JsonMember& member) { return member.key == key; });
    if (found == members.end()) {
      members.push_back({std::string(key), JsonValue(JsonValue::Object{})});
      value = &members.back().value;
    } else {
      value = &found->value;
    }
  }
  return *value->object();
}

JsonValue input_json(const InputRef& input) {
  if (!input.faces.empty()) {
    JsonValue::Object faces;
    for (size_t i = 0; i < input.faces.size(); ++i)
      faces.push_back({kCubeFaceNames.at(i), JsonValue(input.faces[i])});
    return JsonValue(JsonValue::Object{{"faces", JsonValue(std::move(faces))}});
  }
  if (input.resources.empty()) return JsonValue(input.blob);
  JsonValue::Object resources;
  for (const auto& [uri, digest] : input.resources) resources.push_back({uri, JsonValue(digest)});
  return JsonValue(JsonValue::Object{{"blob", JsonValue(input.blob)},
                                     {"resources", JsonValue(std::move(resources))}});
}

}  // namespace

std::string canonical_spec(const Spec& given) {
  Spec spec = given;
  spec.accuracy.target_error = target_error(given);
  spec.accuracy.max_samples = max_samples(given);
  const KindTable& table = kind_table(spec.kind());
  JsonValue root{JsonValue::Object{}};
  object_at(&root, "").push_back({"kind", JsonValue(std::string(kind_name(spec.kind())))});
  for (const InputRow& row : table.inputs) {
    JsonValue::Object& inputs = object_at(&root, "/inputs");
    const std::optional<InputRef>& input = spec.*row.member;
    if (input) inputs.push_back({std::string(row.name), input_json(*input)});
  }
  for (const ParameterGroup& group : table.groups) {
    if (group.present && !group.present(spec)) continue;
    JsonValue::Object& members = object_at(&root, group.path);
    for (const ParameterRow& row : group.rows) {
      if (row.refused) continue;
      members.push_back({std::string(row.name), std::visit(RowWriter{spec}, row.member)});
    }
  }
  JsonWriter writer;
  writer.value(root, true);
  return writer.take();
}

std::string spec_digest(const std::string& canonical_json) {
  const std::string text = std::string("lightkiln ") + kEngineVersion + "\n" + canonical_json;
  return sha256_digest(text.data(), text.size());
}

std::vector<std::string> input_digests(const Spec& spec) {
  std::vector<std::string> digests;
  for (const std::optional<InputRef>* input : {&spec.scene, &spec.environment}) {
    if (!*input) continue;
    if ((*input)->faces.empty()) digests.push_back((*input)->blob);
    digests.insert(digests.end(), (*input)->faces.begin(), (*input)->faces.end());
    for (const auto& [uri, digest] : (*input)->resources) digests.push_back(digest);
  }
  std::sort(digests.begin(), digests.end());
  digests.erase(std::unique(digests.begin(), digests.end()), digests.end());
  return digests;
}

}  // namespace lightkiln
