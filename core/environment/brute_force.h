#pragma once

// What projecting and resampling a map ought to give, by plain sums over its texels in double
// precision: too slow to bake with, and therefore what a few values of each bake are held against.

#include "core/environment/environment.h"

namespace lightkiln {

// A coefficient of the map in the frame of LatlongSpectrum: polar axis +Y, azimuth the longitude; m
// < 0 is the sine of |m|.
Vec3d projected_coefficient(const Environment& environment, int l, int m);

// The mean of the map, constant on each texel and turned by what is pending, over a texel of a
// cube: `meridians` of every column
// of the map, each cut by the four planes of the texel's sides and summed row by row. Its error
// falls as their square: to about 1e-5 of what the columns differ by at 64.
Vec3d texel_average(const Environment& environment, int face, int x, int y, int size,
                    int meridians = 64);

}  // namespace lightkiln
