#pragma once

// Distant light as a lat-long image of radiance, and the one way to look it up.

#include <optional>

#include "core/base/math.h"
#include "core/image/exr.h"

namespace lightkiln {

struct Environment {
  Image radiance;         // lat-long, 3 channels, non-negative and finite, half-texel convention
  PixelRepairs repairs;   // made while loading
  bool constant = false;  // every texel equal: answers come in closed form
  Vec3d mean;             // (1/4pi) integral of radiance, exact texel solid angles
  double max_luminance = 0;
};

// Takes a decoded lat-long image: checks the 2:1 shape, converts 1 channel to 3, resamples
// OpenEXR's texels-on-the-border convention when the file carries `envmap = latlong`, sanitises and
// counts. Throws Error{invalid_input}: wrong shape (a photograph), a cube where a lat-long is
// needed. Hand the image over with std::move: an 8192 x 4096 map takes 384 MiB.
Environment make_environment(DecodedImage decoded);

// A constant environment of the given radiance (1x1 texel).
Environment constant_environment(const Vec3& radiance);

// Radiance of the texel that holds the direction: piecewise constant, the function that the sampler
// draws from exactly.
Vec3 environment_radiance(const Environment& environment, const Vec3& direction);

}  // namespace lightkiln
