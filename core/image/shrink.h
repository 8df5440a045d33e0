#pragma once

// Images made smaller for people to look at.

#include "core/image/image.h"

namespace lightkiln {

// Box-filtered down so that no side exceeds `max_side`, > 0; never enlarged.
Image shrink(const Image& image, int max_side);

}  // namespace lightkiln
