#pragma once

// RGBD: radiance in 8-bit RGBA, the packing of the image-based lights of glTF's extension
// EXT_lights_image_based. The divisor in A makes values above 1 of a colour in [0, 1].

#include "core/base/math.h"
#include "core/image/image.h"
#include "core/image/ldr.h"

namespace lightkiln {

// The brightest value: colour 1 divided by 1/255.
inline constexpr double kMaxRgbd = 255;
// The largest error of a channel relative to its texel's largest one, where that is above 1 and not
// cut: half a step of the colour, 2.2 / 510 at 1, where a divisor of 1 leaves it at half, code 186.
inline constexpr double kRgbdStep = 0.006;

// What packing changed.
struct RgbdLoss {
  double rms = 0;      // over texels and channels of what was not cut, in units of the image
  double largest = 0;  // of any channel that was not cut, in units of the image
  uint64_t cut = 0;    // texels with a channel above kMaxRgbd; their hue is kept
  double cut_off = 0;  // the sum over texels and channels of what cutting took away
};

// Three channels in, four out: value = (rgb / 255)^2.2 / (a / 255), with the largest a, so that the
// colour uses all its steps. A step of the largest channel is at most 0.6 % of it for values above
// 1, and 0.0044 m^0.55 for a largest channel m below. A is never 0. Non-negative and finite values
// only, as sanitise() leaves them.
Image8 encode_rgbd(const Image& image, RgbdLoss* loss = nullptr);

// The value of one texel of four bytes.
Vec3d decode_rgbd(const uint8_t* rgbd);

}  // namespace lightkiln
