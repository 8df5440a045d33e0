#pragma once

// Which accessor formats the attributes, targets and indices of a primitive, and a skin's matrices,
// may have.

#include "core/scene/gltf_model.h"

namespace lightkiln {

// Checks every primitive of the file, also those that no node shows: component types, shapes,
// equal counts of all attributes, plain indices, weights for every target; and the matrices of
// every skin. Throws Error{invalid_input} at the place.
void check_formats(const GltfFile& file, const GltfModel& model);

}  // namespace lightkiln
