#pragma once

// Files that the program carries: the dashboard, the plotting library and the API's description.
// The build writes the table from server/web, its node_modules and proto/openapi.json.

#include <cstddef>
#include <span>

namespace lightkiln {

struct Asset {
  const char* path;  // "/index.html"
  const char* media_type;
  const unsigned char* data;
  size_t size;
};
std::span<const Asset> assets();
// Null when there is none.
const Asset* find_asset(std::span<const Asset> all, const char* path);

}  // namespace lightkiln
