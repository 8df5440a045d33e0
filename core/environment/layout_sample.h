#pragma once

// Reading an image of any layout at a place.

#include "core/image/image.h"
#include "core/sphere/map_layout.h"

namespace lightkiln {

// The texel that holds the place.
Vec3d nearest_radiance(const MapLayout& layout, const Image& image, const MapPlace& place);

// Bilinear between the four samples around the place, across seams, edges and poles; where a sample
// has no continuation (a cube's corner, a horizon) the others share its weight. A weighted mean: it
// never leaves the range of the four. Continuous, also from one chart to the next.
Vec3d smooth_radiance(const MapLayout& layout, const Image& image, const MapPlace& place);

}  // namespace lightkiln
