#pragma once

// EXT_meshopt_compression (the only user of meshoptimizer).

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/scene/gltf_file.h"

namespace lightkiln {

// count * stride bytes. Throws Error{invalid_input} at `where` when the stream is damaged.
std::vector<std::byte> decode_meshopt(const MeshoptStream& stream,
                                      std::span<const std::byte> compressed,
                                      const std::string& where);

}  // namespace lightkiln
