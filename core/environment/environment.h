#pragma once

// Distant light as a lat-long image of radiance, and the one way to look it up.

#include "core/base/math.h"
#include "core/base/progress.h"
#include "core/environment/source_layout.h"
#include "core/image/exr.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"

namespace lightkiln {

struct Environment {
  Image radiance;         // lat-long, 3 channels, non-negative and finite, half-texel convention
  PixelRepairs repairs;   // made while loading
  bool constant = false;  // every texel equal: answers come in closed form
  Vec3d mean;             // (1/4pi) integral of radiance, exact texel solid angles
  double max_luminance = 0;

  // What was read: its layout, and its pixels before rotation when `radiance` is not they
  // themselves.
  MapLayout source_layout;
  Image source;
  Rotation rotation;         // as ordered
  Rotation pending;          // what of it is still to be applied to all that is made of `radiance`
  double covered_share = 1;  // of the sphere, by the source; the rest is black
  // What `radiance` was converted to, see SourceReading; 0 = its texels are the file's own.
  double conversion_error = 0;

  // What other layouts are converted from: the file's own pixels, or `radiance` where light has
  // been taken out of it; `source` is then empty.
  bool reduced = false;
  const Image& source_image() const { return source.pixels.empty() ? radiance : source; }
  MapLayout source_image_layout() const;
  Rotation source_image_rotation() const { return reduced ? pending : rotation; }
};

// Takes a decoded image: finds its layout, converts 1 channel to 3, sanitises and counts, turns and
// brings to a half-texel lat-long of holding_width(). A half-texel lat-long map is kept as it is,
// and a yaw of whole texels only moves its columns; otherwise the map is converted (see
// layout_convert.h, adaptive). Throws Error{invalid_input}: the shape does not fit the layout (a
// photograph), or `reading.strict` and
// NaN, infinite or negative pixels, with their counts. Hand the image over with std::move: an 8192
// x 4096 map takes 384 MiB.
Environment make_environment(DecodedImage decoded, const SourceReading& reading = {},
                             const Rotation& rotation = {}, int threads = 1,
                             Progress* progress = nullptr);

// The same, but a turn that would resample the map is left pending, for those who look `radiance`
// up at R^-1 d themselves: resampling is an error that no bound of theirs tells.
Environment make_pending_environment(DecodedImage decoded, const SourceReading& reading,
                                     const Rotation& rotation, int threads = 1,
                                     Progress* progress = nullptr);

// A constant environment of the given radiance (1x1 texel).
Environment constant_environment(const Vec3& radiance);

// Radiance of the texel that holds the direction: piecewise constant, the function that the sampler
// draws from exactly.
Vec3 environment_radiance(const Environment& environment, const Vec3& direction);

}  // namespace lightkiln
