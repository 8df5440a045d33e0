// Requests of clients: read strictly by the daemon, written by our own client.

#include <algorithm>

#include "proto/json_writer.h"
#include "proto/messages.h"
#include "proto/spec_json.h"

namespace lightkiln {
namespace {

constexpr size_t kMaxNameBytes = 200;
constexpr size_t kMaxLabels = 32;
constexpr size_t kMaxLabelKeyBytes = 63;
constexpr int kMaxPriority = 100;

bool has_control_characters(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return c < 0x20 || c == 0x7F; });
}

void read_short_text(const JsonPlace& place, std::string* out) {
  const std::string allowed =
      "text of at most " + std::to_string(kMaxNameBytes) + " bytes without control characters";
  const std::string* text = place.value->string();
  if (!text)
    place.refuse_type(allowed);
  else if (text->size() > kMaxNameBytes || has_control_characters(*text))
    place.refuse("range", place.pointer + " must be " + allowed + ".", allowed);
  else
    *out = *text;
}

void read_labels(const JsonPlace& place, std::map<std::string, std::string>* out) {
  const JsonValue::Object* members = place.value->object();
  if (!members) return place.refuse_type("an object of texts");
  if (members->size() > kMaxLabels)
    return place.refuse("range", "There are " + std::to_string(members->size()) +
                                     " labels; at most " + std::to_string(kMaxLabels) +
                                     " are allowed.");
  for (const JsonMember& member : *members) {
    const JsonPlace at = place.child(member.key.substr(0, 80), member.value);
    const bool named = !member.key.empty() && member.key.size() <= kMaxLabelKeyBytes &&
                       member.key.find_first_not_of(
                           "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
                           "0123456789._/-") == std::string::npos;
    if (!named)
      at.refuse("range", "A label's key has 1 to 63 of the characters A-Z a-z 0-9 . _ / -.",
                "[A-Za-z0-9._/-]{1,63}");
    read_short_text(at, &(*out)[member.key]);
  }
}

void read_priority(const JsonPlace& place, int* out) {
  const std::string allowed = "a whole number from -100 to 100";
  int64_t number = 0;
  if (!place.value->is_number())
    place.refuse_type(allowed);
  else if (!place.value->to_signed(&number) || number < -kMaxPriority || number > kMaxPriority)
    place.refuse("range", place.pointer + " must be " + allowed + ".", allowed);
  else
    *out = static_cast<int>(number);
}

}  // namespace

ParsedJobRequest parse_job_request(std::string_view json) {
  static constexpr std::string_view kKnown[] = {"spec", "name", "labels", "priority"};
  ParsedJobRequest parsed;
  const JsonValue value = read_json(json, JsonLimits{kMaxRequestBytes, 32}, &parsed.faults);
  if (!parsed.faults.empty()) return parsed;
  FaultList faults;
  const JsonPlace root{&value, "", &faults};
  if (read_object(root, kKnown)) {
    JobRequest& request = parsed.request;
    if (const JsonValue* spec = value.find("spec"))
      request.spec = read_spec(root.child("spec", *spec));
    else
      faults.add({"/spec", "missing", "The spec is missing.", "an object", ""});
    if (const JsonValue* name = value.find("name"))
      read_short_text(root.child("name", *name), &request.name);
    if (const JsonValue* labels = value.find("labels"))
      read_labels(root.child("labels", *labels), &request.labels);
    if (const JsonValue* priority = value.find("priority"))
      read_priority(root.child("priority", *priority), &request.priority);
  }
  parsed.faults = faults.take();
  if (parsed.faults.empty()) {
    parsed.request.canonical = canonical_spec(parsed.request.spec);
    parsed.request.spec_digest = spec_digest(parsed.request.canonical);
  }
  return parsed;
}

std::string write_job_request(const std::string& spec_json, const std::string& name,
                              const std::map<std::string, std::string>& labels, int priority) {
  JsonWriter writer;
  writer.begin_object().key("spec").value(
      read_trusted_json(spec_json, ErrorCode::invalid_spec, "The order"));
  if (!name.empty()) writer.member("name", name);
  if (!labels.empty()) {
    writer.key("labels").begin_object();
    for (const auto& [key, value] : labels) writer.member(key, value);
    writer.end_object();
  }
  if (priority != 0) writer.member("priority", priority);
  writer.end_object();
  return writer.take();
}

ParsedDigests parse_digests(std::string_view json) {
  static constexpr std::string_view kKnown[] = {"digests"};
  ParsedDigests parsed;
  const JsonValue value = read_json(json, JsonLimits{kMaxRequestBytes, 32}, &parsed.faults);
  if (!parsed.faults.empty()) return parsed;
  FaultList faults;
  const JsonPlace root{&value, "", &faults};
  const JsonValue* list = read_object(root, kKnown) ? value.find("digests") : nullptr;
  if (!list && faults.empty())
    faults.add({"/digests", "missing", "The list of digests is missing.", "a list", ""});
  if (list && !list->array()) root.child("digests", *list).refuse_type("a list of digests");
  if (list && list->array()) {
    const JsonPlace place = root.child("digests", *list);
    const JsonValue::Array& items = *list->array();
    if (items.size() > kMaxDigestsPerRequest)
      place.refuse("range", "At most " + std::to_string(kMaxDigestsPerRequest) +
                                " digests are taken at once; there are " +
                                std::to_string(items.size()) + ".");
    for (size_t i = 0; i < items.size(); ++i) {
      const std::string* text = items[i].string();
      if (text && is_digest(*text))
        parsed.digests.push_back(*text);
      else
        place.child(std::to_string(i), items[i])
            .refuse("type", "A digest is \"sha256:\" and 64 lower-case hex digits.",
                    "sha256:<64 hex>");
    }
  }
  parsed.faults = faults.take();
  return parsed;
}

std::string write_digests(const std::vector<std::string>& digests) {
  JsonWriter writer;
  writer.begin_object().member("digests", digests).end_object();
  return writer.take();
}

}  // namespace lightkiln
