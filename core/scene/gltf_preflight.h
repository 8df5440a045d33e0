#pragma once

// The first look at a client's bytes: which container, and JSON that is no deeper, larger or
// stranger than allowed. Nothing here trusts a length that the file states about itself.

#include <cstddef>
#include <span>

#include "core/scene/gltf_json.h"

namespace lightkiln {

inline constexpr int kMaxJsonDepth = 64;
inline constexpr size_t kMaxJsonValues = 4'000'000;

struct GltfContainer {
  std::span<const std::byte> json;
  std::span<const std::byte> bin;  // the GLB's second chunk
  bool is_glb = false;
  bool has_bin = false;
};

// Splits a GLB into its chunks (glTF 2.0, section 4.4); anything else is taken for the JSON of a
// .gltf. Chunks of unknown type are passed over. Throws Error{invalid_input, unsupported}.
GltfContainer open_gltf_container(std::span<const std::byte> file);

// Throws Error: invalid_input for malformed JSON, a key that appears twice, or a root that is no
// object; too_large beyond max_bytes, kMaxJsonDepth or kMaxJsonValues.
JsonValue parse_gltf_json(std::span<const std::byte> text, uint64_t max_bytes);

}  // namespace lightkiln
