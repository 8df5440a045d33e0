#pragma once

// Conversions of layouts held against their twin.

#include "core/bake/maps_output.h"
#include "core/environment/layout_truth.h"

namespace lightkiln {

// `image`, the source in another layout, at up to `check_texels` texels that show something: by how
// much it differs from layout_truth(), relative to the source's mean or to the brightest texel that
// each of them shows, whichever is more.
MeasuredError check_layout(const ConversionSource& source, const MapLayout& layout,
                           const Image& image, const Rotation& rotation, MapFilter filter,
                           int check_texels, int threads, Progress& progress);

}  // namespace lightkiln
