#pragma once

// KHR_draco_mesh_compression (the only user of Draco).

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/scene/gltf_file.h"

namespace lightkiln {

struct DracoRequest {
  size_t accessor = 0;     // whose component type and count to produce
  uint32_t unique_id = 0;  // of the attribute in the stream
};

// Packed bytes by accessor index, as if each accessor had a buffer view of its own.
using DecodedAccessors = std::map<size_t, std::vector<std::byte>>;

// Decodes one primitive: its attributes and, for accessor `indices`, its triangles. Throws Error
// at `where`: invalid_input for a damaged stream or counts other than the accessors'.
DecodedAccessors decode_draco(const GltfFile& file, std::span<const std::byte> compressed,
                              const std::vector<DracoRequest>& attributes, size_t indices,
                              const std::string& where);

}  // namespace lightkiln
