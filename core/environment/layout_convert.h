#pragma once

// From any layout to any other.

#include "core/base/progress.h"
#include "core/image/image.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"

namespace lightkiln {

enum class MapFilter {
  // The mean of the source, as a function that is constant on each of its texels, over the solid
  // angle of the target's texel: the texel's outline is laid over the source's grid and every
  // texel below it counts with the exact area it shares. Keeps energy at any scale; enlarged, the
  // source's texels show as steps.
  area,
  // `area` where a texel of the target spans 1.5 texels of the source or more in every direction;
  // where it spans less than one in some direction, the mean of the bilinear interpolation of the
  // source, which is continuous and never leaves the range of its neighbours (no ringing, no
  // negative value); in between, a mixture of both.
  adaptive
};

// Texels are only moved: equal layouts, or cube layouts of one face size and convention, unturned.
bool moves_texels(const MapLayout& from, const MapLayout& to, const Rotation& rotation);

// `source` (3 channels, of layout `from`) turned by `rotation`, as an image of layout `to`. What
// the source does not cover is black; what the target does not show is 0. Between cube layouts of
// one face size and convention, or equal layouts, without rotation, texels are moved and nothing is
// computed. At a texel that straddles a seam of the source the shares come from a grid of at least
// eight points per source texel's side. Border texels that repeat a direction (openexr) are equal
// to the bit. The same bits for any number of threads. Throws Error{invalid_input} when an image
// and its layout disagree or a layout is faulty.
Image convert_layout(const MapLayout& from, const Image& source, const MapLayout& to,
                     const Rotation& rotation, MapFilter filter, int threads, Progress& progress);

}  // namespace lightkiln
