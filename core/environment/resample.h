#pragma once

// A lat-long map on the faces of a cube, by area.

#include "core/base/progress.h"
#include "core/image/image.h"

namespace lightkiln {

// Each texel of the cube (face_size wide, 6 face_size high, faces +X -X +Y -Y +Z -Z) is the mean of
// the map, as a function that is constant on each of its texels, over the solid angle of the cube's
// texel: in closed form, whatever the sizes and however hard the light. Nothing is skipped and
// nothing rings: energy is kept and a constant stays. The same bits for any number of threads.
// `progress` may be told from two threads at once.
Image resample_to_cube(const Image& latlong, int face_size, int threads, Progress& progress);

// What is left of a texel, relative to itself: half a step of float. No order makes it cheaper.
inline constexpr double kResampleRounding = 6e-8;

}  // namespace lightkiln
