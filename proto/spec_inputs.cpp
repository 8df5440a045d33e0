#include "proto/spec_inputs.h"

#include <algorithm>

#include "proto/json.h"

namespace lightkiln {
namespace {

constexpr size_t kMaxResources = 10000;
constexpr size_t kMaxUriBytes = 2048;

bool read_digest(const JsonPlace& place, std::string* out) {
  const std::string* text = place.value->string();
  if (!text || !is_digest(*text)) {
    place.refuse("type",
                 place.pointer + " must be a digest: \"sha256:\" and 64 lower-case hex digits.",
                 "sha256:<64 hex>");
    return false;
  }
  *out = *text;
  return true;
}

void read_resources(const JsonPlace& place, InputRef* out) {
  const JsonValue::Object* members = place.value->object();
  if (!members) return place.refuse_type("an object of URIs and digests");
  if (members->size() > kMaxResources)
    return place.refuse("range", place.pointer + " names " + std::to_string(members->size()) +
                                     " files; at most " + std::to_string(kMaxResources) +
                                     " are allowed.");
  for (const JsonMember& member : *members) {
    const JsonPlace at = place.child(member.key.substr(0, 80), member.value);
    if (member.key.empty() || member.key.size() > kMaxUriBytes)
      at.refuse("range", "A URI has 1 to " + std::to_string(kMaxUriBytes) + " bytes.");
    std::string digest;
    if (read_digest(at, &digest)) out->resources.emplace_back(member.key, digest);
  }
  std::sort(out->resources.begin(), out->resources.end());
}

// All six, in our order whatever the order of the members.
void read_faces(const JsonPlace& place, InputRef* out) {
  const std::vector<std::string_view> known(kCubeFaceNames.begin(), kCubeFaceNames.end());
  out->faces.resize(known.size());
  if (!read_object(place, known)) return;
  for (size_t i = 0; i < known.size(); ++i) {
    if (const JsonValue* face = place.value->find(known[i]))
      read_digest(place.child(known[i], *face), &out->faces[i]);
    else
      place.faults->add({place.pointer + "/" + std::string(known[i]), "missing",
                         "The face " + std::string(known[i]) + " is missing; a cube has six.",
                         "sha256:<64 hex>", ""});
  }
}

InputRef read_input(const JsonPlace& place, const InputRow& row) {
  InputRef input;
  if (!place.value->object()) {
    read_digest(place, &input.blob);
    return input;
  }
  const std::string_view known[] = {"blob", row.image ? "faces" : "resources"};
  read_object(place, known);
  const JsonValue* faces = row.image ? place.value->find("faces") : nullptr;
  if (faces) {
    read_faces(place.child("faces", *faces), &input);
    if (place.value->find("blob"))
      place.faults->add({place.pointer + "/blob", "conflict",
                         "An environment is one file or six faces, not both.", "", ""});
    return input;
  }
  if (const JsonValue* blob = place.value->find("blob"))
    read_digest(place.child("blob", *blob), &input.blob);
  else
    place.faults->add({place.pointer + "/blob", "missing",
                       "The digest of the main file is missing.", "sha256:<64 hex>", ""});
  const JsonValue* resources = row.image ? nullptr : place.value->find("resources");
  if (resources) read_resources(place.child("resources", *resources), &input);
  return input;
}

}  // namespace

void read_inputs(const JsonPlace& root, const KindTable& table, Spec* spec) {
  std::vector<std::string_view> known;
  for (const InputRow& row : table.inputs) known.push_back(row.name);
  const JsonValue* inputs = root.value->find("inputs");
  const JsonPlace place = root.child("inputs", inputs ? *inputs : *root.value);
  if (inputs && !read_object(place, known)) return;
  for (const InputRow& row : table.inputs) {
    const JsonValue* input = inputs ? inputs->find(row.name) : nullptr;
    if (input)
      (*spec).*row.member = read_input(place.child(row.name, *input), row);
    else if (row.required)
      place.faults->add({place.pointer + "/" + std::string(row.name), "missing",
                         "The input \"" + std::string(row.name) + "\" is missing; " +
                             kind_name(table.kind) + " needs it.",
                         "a digest", ""});
  }
}

}  // namespace lightkiln
