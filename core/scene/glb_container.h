#pragma once

// The GLB container of glTF 2.0: a JSON chunk and a binary one.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace lightkiln {

// Both chunks padded to four bytes, as the format asks; no binary chunk when `bin` is empty. Throws
// Error{too_large} from 4 GiB on.
std::vector<std::byte> glb_container(const std::string& json, std::span<const std::byte> bin);

}  // namespace lightkiln
