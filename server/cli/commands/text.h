#pragma once

// How things look on a terminal.

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

namespace lightkiln::cli {

// Text of a server or a file with control characters made harmless.
std::string printable(const std::string& text);

std::string format_seconds(double seconds);  // "0.42 s", "3 min 20 s", "2 h 05 min"
std::string format_error(double error);      // three digits: "0.0123"
std::string format_count(uint64_t count);    // "12 345 678"

// A count with its noun: "1 vertex", "0 vertices", "2 chunks".
std::string format_units(uint64_t count, const std::string& unit);

struct Table {
  std::vector<std::string> header;
  std::vector<bool> right;  // align to the right, by column
  std::vector<std::vector<std::string>> rows;
};
void print_table(std::ostream& out, const Table& table);

}  // namespace lightkiln::cli
