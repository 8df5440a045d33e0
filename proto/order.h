#pragma once

// An order in a file: a spec whose inputs are paths. The paths become digests, and a .gltf brings
// along the files that its URIs name.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/json.h"

namespace lightkiln {

struct OrderBlob {
  std::string digest;
  std::filesystem::path file;
  uint64_t bytes = 0;
};

struct Order {
  std::string spec_json;         // with digests; not validated
  std::vector<OrderBlob> blobs;  // every file, each digest once
};

// Reads the order file at `path`; paths in it are relative to its folder. An input may be a path, a
// digest, {"blob": path or digest, "resources": {URI: path or digest}}, or {"faces": {name: path or
// digest}}. Throws Error: not_found
// when the order file cannot be read, invalid_spec when it is no JSON object or names a file that
// cannot be read (where() has the pointer).
Order read_order(const std::filesystem::path& path);

// The URIs of a .gltf that name files, percent-decoded, each once; data: URIs are not listed.
// Throws Error{invalid_spec} when one is absolute, has a scheme or leads upwards.
std::vector<std::string> gltf_file_uris(std::string_view gltf_json);

}  // namespace lightkiln
