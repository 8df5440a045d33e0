#pragma once

// Decodes the textures that the baked materials read: base colour and emission, nothing else.

#include "core/scene/gltf_bytes.h"
#include "core/scene/gltf_model.h"

namespace lightkiln {

// Fills scene.textures and turns the materials' slots from glTF indices into indices of it. Slots
// of materials that no mesh uses, and of textures without an image that can be read, become -1 (the
// latter with a warning). Throws Error: invalid_input at /images/<i>, too_large over
// limits.max_texels.
void load_textures(Scene& scene, const GltfModel& model, GltfBytes& bytes,
                   const GltfLoadOptions& options);

}  // namespace lightkiln
