#include "server/http/log.h"

#include <charconv>
#include <chrono>

#include <unistd.h>

#include "core/base/error.h"
#include "proto/messages.h"
#include "server/http/head.h"

namespace lightkiln {

namespace {

constexpr size_t kFieldBytes = 256;
constexpr const char* kLevelNames[] = {"error", "warning", "info", "debug"};

void append_text(std::string& line, std::string_view text) {
  text = text.substr(0, kFieldBytes);
  const bool plain = is_utf8(text);
  line += '"';
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      line += '\\';
      line += c;
    } else if (byte < 0x20 || byte == 0x7f || (byte >= 0x80 && !plain)) {
      static constexpr char kHex[] = "0123456789abcdef";
      line += "\\u00";
      line += kHex[byte >> 4];
      line += kHex[byte & 15];
    } else {
      line += c;
    }
  }
  line += '"';
}

template <typename Number>
void append_number(std::string& line, Number value) {
  char buffer[40];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value);
  line.append(buffer, end.ptr);
}

}  // namespace

LogLevel parse_log_level(std::string_view word) {
  for (int i = 0; i < 4; ++i)
    if (word == kLevelNames[i]) return static_cast<LogLevel>(i);
  throw Error(ErrorCode::invalid_spec, "The log level '" + std::string(word) +
                                           "' is not known; allowed: error, warning, info, debug.");
}

void Log::write(LogLevel level, std::string_view event, LogFields fields) {
  if (!enabled(level)) return;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  std::string line = "{\"time\":\"";
  line += format_time(std::chrono::duration_cast<std::chrono::milliseconds>(now).count());
  line += "\",\"level\":\"";
  line += kLevelNames[static_cast<int>(level)];
  line += "\",\"event\":";
  append_text(line, event);
  for (const auto& [name, value] : fields) {
    line += ",\"";
    line += name;
    line += "\":";
    if (const auto* text = std::get_if<std::string_view>(&value)) append_text(line, *text);
    if (const auto* whole = std::get_if<int64_t>(&value)) append_number(line, *whole);
    if (const auto* real = std::get_if<double>(&value)) append_number(line, *real);
  }
  line += "}\n";
  std::lock_guard lock(mutex_);
  // A log that cannot be written must not stop the service; there is nowhere left to say so.
  (void)!::write(descriptor_, line.data(), line.size());
}

}  // namespace lightkiln
