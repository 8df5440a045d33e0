#pragma once

// A cube that comes as six files.

#include <array>

#include "core/environment/lookup_cube.h"
#include "core/image/image.h"

namespace lightkiln {

// Of the faces +X -X +Y -Y +Z -Z in specs, file names and messages.
inline constexpr std::array<const char*, 6> kCubeFaceNames = {"px", "nx", "py", "ny", "pz", "nz"};

// The six images, framed (see frame_as_displayed) and oriented as they come, as one strip N x 6N
// with three channels; the layout that each file claims is dropped. Throws Error{invalid_input}:
// faces that are not squares of one size, by name.
DecodedImage join_faces(std::array<DecodedImage, 6> faces);

}  // namespace lightkiln
