#pragma once

// What a conversion of layouts loses.

#include <optional>

#include "core/base/progress.h"
#include "core/image/image.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"

namespace lightkiln {

struct RoundTrip {
  // Root mean square over R, G, B of what comes back less what was there, weighted by solid angle,
  // relative to the root mean square of the source. 0 = nothing is lost.
  double relative_rms = 0;
  // 20 log10(largest value of the source / rms difference); none when nothing is lost.
  std::optional<double> psnr_db;
  // The part of the sphere that the source covers and the target does not show, in [0, 1].
  double not_covered_share = 0;
  // Mean luminance over what both cover, before and after, by exact texel solid angles.
  double mean_before = 0, mean_after = 0;
};

// Looks every texel of the source up again in the converted image, at the direction of its centre
// and bilinearly, as a reader of the target would. Of images above a million texels every k-th row
// and column is looked up, and every texel above 64 times the mean.
RoundTrip measure_round_trip(const MapLayout& from, const Image& source, const MapLayout& to,
                             const Image& converted, const Rotation& rotation, int threads,
                             Progress& progress);

}  // namespace lightkiln
