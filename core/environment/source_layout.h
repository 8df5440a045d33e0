#pragma once

// What layout an image file has, and what a half-texel lat-long needs to hold it.

#include <optional>
#include <string>

#include "core/environment/layout_convert.h"
#include "core/environment/lookup_cube.h"
#include "core/image/exr.h"
#include "core/sphere/map_layout.h"

namespace lightkiln {

// How a client says that a file is to be read; nothing said = as the file itself says.
struct SourceReading {
  std::optional<LayoutKind> layout = {};
  std::optional<TexelConvention> convention = {};
  double camera_distance = 0;  // mirror_ball: as in MapLayout
  bool mirrored = false;       // angular, mirror_ball: as in MapLayout
  // cube_strip; crosses are the same in either
  FaceOrientation face_orientation = FaceOrientation::openexr;
  bool strict = false;  // refuses pixels that would be repaired
  // What a map that is brought to a lat-long is converted to: relative rms, see convert_layout().
  double conversion_error = kConversionError;
};

// The layout of a file: the one that is said, else the one its `envmap` attribute names, else
// lat-long. The convention: the one that is said, else openexr when the attribute names this
// layout, else half_texel. Throws Error{invalid_input}: an image whose shape does not fit, with the
// shapes that would.
MapLayout source_layout(const DecodedImage& decoded, const SourceReading& reading);

// The width of a half-texel lat-long image whose texels are as narrow as the narrowest that the
// layout resolves: W of a lat-long map, 2 W when its samples do not fall on ours (openexr, turned),
// 8 N of a cube, 2 N of an angular map or ball, 4 N of the other squares, 2 W of a cylinder; no
// more than 8192 unless the source is that wide itself.
int holding_width(const MapLayout& layout, bool turned);

}  // namespace lightkiln
