#include "proto/faults.h"

#include <algorithm>

namespace lightkiln {

void FaultList::add(SpecFault fault) {
  if (faults_.size() < kMaxFaults)
    faults_.push_back(std::move(fault));
  else
    ++untold_;
}

bool FaultList::concerns(std::string_view pointer) const {
  const auto leads_to = [](std::string_view above, std::string_view below) {
    return below.starts_with(above) && (below.size() == above.size() || below[above.size()] == '/');
  };
  return std::any_of(faults_.begin(), faults_.end(), [&](const SpecFault& fault) {
    return leads_to(fault.pointer, pointer) || leads_to(pointer, fault.pointer);
  });
}

std::vector<SpecFault> FaultList::take() {
  if (untold_ > 0)
    faults_.push_back(
        {"", "too_many", "There are " + std::to_string(untold_) + " more faults like these."});
  untold_ = 0;
  return std::move(faults_);
}

JsonPlace JsonPlace::child(std::string_view key, const JsonValue& part) const {
  return {&part, pointer + "/" + json_pointer_token(key), faults};
}

void JsonPlace::refuse(const char* code, const std::string& message,
                       const std::string& allowed) const {
  faults->add({pointer, code, message, allowed, ""});
}

void JsonPlace::refuse_type(const std::string& allowed) const {
  const std::string name = pointer.empty() ? "The document" : pointer;
  refuse("type", name + " must be " + allowed + ", not " + value->type_name() + ".", allowed);
}

bool read_object(const JsonPlace& place, std::span<const std::string_view> known) {
  const JsonValue::Object* members = place.value->object();
  if (!members) {
    place.refuse_type("an object");
    return false;
  }
  for (const JsonMember& member : *members) {
    if (std::find(known.begin(), known.end(), member.key) != known.end()) continue;
    const std::string near = nearest_name(member.key, known);
    std::string message = "There is no member \"" + member.key.substr(0, 80) + "\" here";
    message += near.empty() ? "; known are " + join_names(known) + "."
                            : "; did you mean \"" + near + "\"?";
    const JsonPlace at = place.child(member.key, member.value);
    place.faults->add({at.pointer, "unknown", message, join_names(known), near});
  }
  return true;
}

std::string nearest_name(std::string_view name, std::span<const std::string_view> known) {
  std::string best;
  size_t best_distance = SIZE_MAX;
  if (name.size() > 64) return best;
  std::vector<size_t> row;
  for (const std::string_view candidate : known) {
    // row[j] = edits that turn the first i letters of `name` into the first j of `candidate`.
    row.resize(candidate.size() + 1);
    for (size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (size_t i = 1; i <= name.size(); ++i) {
      size_t diagonal = row[0];
      row[0] = i;
      for (size_t j = 1; j < row.size(); ++j) {
        const size_t replaced = diagonal + (name[i - 1] == candidate[j - 1] ? 0 : 1);
        diagonal = row[j];
        row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
      }
    }
    const size_t allowed = std::max<size_t>(1, std::max(name.size(), candidate.size()) / 3);
    if (row.back() <= allowed && row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

std::string join_names(std::span<const std::string_view> names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " or " : ", ";
    text += names[i];
  }
  return text;
}

}  // namespace lightkiln
