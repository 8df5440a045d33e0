// Times, paths and digest headers.

#include <charconv>
#include <chrono>
#include <cstdio>

#include "core/base/error.h"
#include "proto/messages.h"

namespace lightkiln {
namespace {

// The number that fills text[begin, begin + size), or throws.
int digits_at(std::string_view text, size_t begin, size_t size) {
  int number = 0;
  const char* first = text.data() + begin;
  const auto [end, error] = std::from_chars(first, first + size, number);
  if (error != std::errc() || end != first + size || *first == '-')
    throw Error(ErrorCode::invalid_input, "\"" + std::string(text) + "\" is not an RFC 3339 time.");
  return number;
}

}  // namespace

std::string format_time(int64_t unix_ms) {
  using namespace std::chrono;
  const sys_time<milliseconds> time{milliseconds(unix_ms)};
  const auto day = floor<days>(time);
  const year_month_day date(day);
  const hh_mm_ss clock(time - day);
  char text[40];
  std::snprintf(
      text, sizeof text, "%04d-%02u-%02uT%02d:%02d:%02d.%03dZ", static_cast<int>(date.year()),
      static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
      static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
      static_cast<int>(clock.seconds().count()), static_cast<int>(clock.subseconds().count()));
  return text;
}

int64_t parse_time(std::string_view text) {
  using namespace std::chrono;
  static constexpr std::string_view kShape = "####-##-##T##:##:##.###Z";
  bool shaped = text.size() == kShape.size();
  for (size_t i = 0; shaped && i < text.size(); ++i)
    shaped = kShape[i] == '#' || kShape[i] == text[i];
  if (!shaped)
    throw Error(ErrorCode::invalid_input, "\"" + std::string(text) + "\" is not an RFC 3339 time.");
  const year_month_day date{year(digits_at(text, 0, 4)),
                            month(static_cast<unsigned>(digits_at(text, 5, 2))),
                            day(static_cast<unsigned>(digits_at(text, 8, 2)))};
  if (!date.ok()) throw Error(ErrorCode::invalid_input, "\"" + std::string(text) + "\" is no day.");
  const milliseconds since_midnight =
      hours(digits_at(text, 11, 2)) + minutes(digits_at(text, 14, 2)) +
      seconds(digits_at(text, 17, 2)) + milliseconds(digits_at(text, 20, 3));
  return (sys_days(date).time_since_epoch() + since_midnight).count();
}

std::string percent_encode(std::string_view text) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '.' || c == '_' || c == '~';
    const auto byte = static_cast<unsigned char>(c);
    if (plain)
      out += c;
    else
      out += {'%', kHex[byte >> 4], kHex[byte & 15]};
  }
  return out;
}

std::string job_href(const std::string& id) {
  return std::string(kApiPrefix) + "/jobs/" + percent_encode(id);
}

std::string artifact_href(const std::string& id, const std::string& name) {
  return job_href(id) + "/artifacts/" + percent_encode(name);
}

std::string repr_digest(const std::string& digest) {
  static constexpr char kAlphabet[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (!is_digest(digest)) throw Error(ErrorCode::internal, "\"" + digest + "\" is not a digest.");
  std::string out = "sha-256=:";
  unsigned bits = 0;
  unsigned held = 0;  // bits not written yet
  for (size_t i = 7; i < digest.size(); ++i) {
    const char c = digest[i];
    bits = bits << 4 | static_cast<unsigned>(c <= '9' ? c - '0' : c - 'a' + 10);
    held += 4;
    if (held < 6) continue;
    held -= 6;
    out += kAlphabet[bits >> held & 63u];
  }
  // 256 bits are 42 digits and 4 bits over (RFC 4648, section 4).
  out += kAlphabet[bits << (6 - held) & 63u];
  return out + "=:";
}

}  // namespace lightkiln
