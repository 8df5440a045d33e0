#pragma once

// A cube as graphics interfaces look it up, for viewers that take six images.

#include "core/image/image.h"

namespace lightkiln {

// Face 0..5 = +X -X +Y -Y +Z -Z of `cube` (our strip of six faces, direction_map.h) as the six
// images of EXT_lights_image_based: OpenGL's cube map faces in the left-handed world (-x, y, z) of
// the extension's viewers (sh_target_axes), bottom row first. Ours of +-X are theirs of -+X. Texels
// are moved, never filtered.
Image lookup_face(const Image& cube, int face);

}  // namespace lightkiln
