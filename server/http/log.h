#pragma once

// The log: one JSON object a line on standard error. Texts are escaped and cut at 256 bytes, so
// that no client can forge a line or fill the disk with one. Secrets and file paths are never
// handed in.

#include <initializer_list>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace lightkiln {

enum class LogLevel { error, warning, info, debug };
// Throws Error{invalid_spec} naming the allowed words.
LogLevel parse_log_level(std::string_view word);

using LogValue = std::variant<std::string_view, int64_t, double>;
using LogFields = std::initializer_list<std::pair<const char*, LogValue>>;

class Log {
 public:
  explicit Log(LogLevel level, int descriptor = 2) : level_(level), descriptor_(descriptor) {}

  bool enabled(LogLevel level) const { return level <= level_; }
  // {"time":…,"level":…,"event":…,fields…}. One write per line; thread-safe.
  void write(LogLevel level, std::string_view event, LogFields fields = {});

 private:
  const LogLevel level_;
  const int descriptor_;
  std::mutex mutex_;
};

}  // namespace lightkiln
