#pragma once

// Accessor elements as plain numbers: any component type, normalisation, stride and sparse
// replacement (glTF 2.0, section 3.6.2).

#include <cstdint>
#include <vector>

#include "core/scene/gltf_bytes.h"
#include "core/scene/gltf_draco.h"

namespace lightkiln {

// Reads accessors of one primitive; `decoded` holds those that a Draco stream gave, if any.
struct AccessorSource {
  const GltfFile& file;
  GltfBytes& bytes;
  const DecodedAccessors* decoded = nullptr;
};

// count * components() values, column by column for a matrix. Integers become c, or for normalised
// ones c / max (signed: not below -1). Throws Error{invalid_input} for bytes that are missing or
// sparse indices that are out of order or range.
std::vector<float> read_floats(const AccessorSource& source, size_t accessor);

// The same for unsigned integers; throws Error{invalid_input} for any other component type.
std::vector<uint32_t> read_unsigned(const AccessorSource& source, size_t accessor);

}  // namespace lightkiln
