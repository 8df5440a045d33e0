#include "server/cli/commands/text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace lightkiln::cli {
namespace {

// Columns of UTF-8 text, one a code point.
size_t width(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(),
                                           [](unsigned char c) { return (c & 0xC0u) != 0x80u; }));
}

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[64];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace

std::string printable(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    // The C1 controls U+0080 to U+009F are C2 80 to C2 9F in UTF-8.
    const bool c1 =
        c == 0xC2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xA0;
    if (c1) ++i;
    out += c < 0x20 || c == 0x7F || c1 ? '?' : text[i];
  }
  return out;
}

std::string format_seconds(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return "?";
  if (seconds < 10) return formatted("%.2f s", seconds);
  if (seconds < 120) return formatted("%.0f s", seconds);
  const auto whole = static_cast<uint64_t>(std::min(seconds, 1e15));
  if (whole < 7200)
    return formatted("%llu min %02llu s", static_cast<unsigned long long>(whole / 60),
                     static_cast<unsigned long long>(whole % 60));
  return formatted("%llu h %02llu min", static_cast<unsigned long long>(whole / 3600),
                   static_cast<unsigned long long>(whole / 60 % 60));
}

std::string format_error(double error) {
  return formatted("%.3g", error);
}

std::string format_count(uint64_t count) {
  std::string digits = std::to_string(count);
  for (size_t at = digits.size(); at > 3;) {
    at -= 3;
    digits.insert(at, 1, ' ');
  }
  return digits;
}

std::string format_units(uint64_t count, const std::string& unit) {
  std::string plural = unit + 's';
  if (unit.ends_with("ex")) plural = unit.substr(0, unit.size() - 2) + "ices";
  return format_count(count) + ' ' + (count == 1 ? unit : plural);
}

void print_table(std::ostream& out, const Table& table) {
  std::vector<size_t> widths;
  for (const std::string& name : table.header) widths.push_back(width(name));
  for (const auto& row : table.rows)
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width(row[i]));
  const auto print = [&](const std::vector<std::string>& cells) {
    std::string line;
    for (size_t i = 0; i < cells.size(); ++i) {
      const std::string gap(widths[i] - width(cells[i]), ' ');
      const bool right = i < table.right.size() && table.right[i];
      if (i > 0) line.append(2, ' ');
      line += right ? gap + cells[i] : cells[i] + gap;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out << line << '\n';
  };
  print(table.header);
  for (const auto& row : table.rows) print(row);
}

}  // namespace lightkiln::cli
