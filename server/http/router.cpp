#include "server/http/router.h"

#include <algorithm>

namespace lightkiln {

void Router::add(std::string method, std::string_view pattern) {
  Entry entry;
  entry.method = std::move(method);
  pattern.remove_prefix(1);
  while (!pattern.empty()) {
    const size_t slash = std::min(pattern.find('/'), pattern.size());
    const std::string_view text = pattern.substr(0, slash);
    pattern.remove_prefix(std::min(slash + 1, pattern.size()));
    Segment segment;
    if (text.starts_with('{')) {
      const size_t brace = text.find('}');
      segment.parameter = true;
      segment.any_colon = text.substr(0, brace + 1) == "{digest}";
      segment.text = std::string(text.substr(brace + 1));
    } else {
      segment.text = std::string(text);
    }
    entry.segments.push_back(std::move(segment));
  }
  entries_.push_back(std::move(entry));
}

bool Router::matches(const Entry& entry, const std::vector<std::string>& segments,
                     std::vector<std::string>& values) {
  if (entry.segments.size() != segments.size()) return false;
  values.clear();
  for (size_t i = 0; i < segments.size(); ++i) {
    const Segment& wanted = entry.segments[i];
    std::string_view given = segments[i];
    if (!wanted.parameter) {
      if (given != wanted.text) return false;
      continue;
    }
    if (!given.ends_with(wanted.text)) return false;
    given.remove_suffix(wanted.text.size());
    if (given.empty()) return false;
    if (!wanted.any_colon && given.find(':') != std::string_view::npos) return false;
    values.emplace_back(given);
  }
  return true;
}

Router::Match Router::match(std::string_view method,
                            const std::vector<std::string>& segments) const {
  Match result;
  std::vector<std::string> values;
  int fallback = -1;
  for (size_t i = 0; i < entries_.size(); ++i) {
    if (!matches(entries_[i], segments, values)) continue;
    if (entries_[i].method == method) {
      result.route = static_cast<int>(i);
      result.values = values;
      return result;
    }
    if (method == "HEAD" && entries_[i].method == "GET" && fallback < 0) {
      fallback = static_cast<int>(i);
      result.values = values;
    }
    result.allowed.push_back(entries_[i].method);
  }
  if (fallback >= 0) {
    result.route = fallback;
    return result;
  }
  const auto get = std::find(result.allowed.begin(), result.allowed.end(), "GET");
  const auto head = std::find(result.allowed.begin(), result.allowed.end(), "HEAD");
  if (get != result.allowed.end() && head == result.allowed.end())
    result.allowed.emplace_back("HEAD");
  return result;
}

}  // namespace lightkiln
