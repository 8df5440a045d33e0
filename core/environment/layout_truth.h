#pragma once

// What a conversion of layouts ought to give, by integration along lines: too slow to convert with,
// and therefore what a few texels of each conversion are held against.
//
// The ideal texel is the mean, by solid angle, of the source over all that the texel shows:
//   V = integral of g(d(p)) w(p) dp / integral of w(p) dp
// over the points p of the texel, d(p) their directions (turned back), w(p) = d(solid angle) /
// d(p). Texels that repeat one direction (openexr) are the mean over all of them together. Where
// the source does not cover d, g = 0; else, at the source's place q(p),
//   g = (1 - s) N(q) + s B(q),
// N the value of the texel that holds q (nearest_radiance), B the interpolation between the texels
// around it (smooth_radiance), both of layout_sample.h, and s the share of smoothing: 0 with
// MapFilter::area; with `adaptive` clamp(2 - 2 m, 0, 1), m the least number of source texels that a
// texel of the target spans in any direction, the smaller singular value of dq/dp. Shrinking is
// therefore the mean of N, and enlarging the mean of B.

#include "core/environment/layout_convert.h"

namespace lightkiln {

struct LayoutTruth {
  Vec3d radiance;        // 0 where the texel shows nothing
  double brightest = 0;  // the largest value of a channel that was met on the way
};

// The ideal of texel (x, y) of the target in double precision. With `lines` per texel's side it is
// within about 4e-4 of the difference between neighbouring texels of the source where a texel shows
// a dozen of them, and within 1e-5 where it shows a part of one.
LayoutTruth layout_truth(const MapLayout& from, const Image& source, const MapLayout& to,
                         const Rotation& rotation, MapFilter filter, int x, int y, int lines = 64);

}  // namespace lightkiln
