#pragma once

// Any image a client may send as light: chooses the reader by the file's first bytes.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/image/exr.h"

namespace lightkiln {

// OpenEXR or Radiance HDR. Throws Error{invalid_input} that names what was found instead.
DecodedImage decode_hdr_image(std::span<const std::byte> bytes);

// Any image as light: OpenEXR, Radiance HDR, PNG or JPEG (see read_ldr_as_light), framed as
// frame_as_displayed() says. Throws Error{invalid_input} that names what was found instead.
DecodedImage decode_light_image(std::span<const std::byte> bytes);

// Gives an image whose data window is not its display window the frame that a map has:
// - With OpenEXR's `envmap` attribute the data window is the map, as that standard says.
// - Without, the display window is, as it is what viewers show and what programs crop to the pixels
//   that are not black: pixels missing in it are black, pixels outside it are dropped. Both are
//   counted in `decoded`.
// Throws Error: invalid_input when the two do not meet, too_large as read_exr.
void frame_as_displayed(DecodedImage& decoded);

// What a plan warns of: a picture made for a screen, which holds no light brighter than white, and
// pixels that were missing or dropped.
std::vector<std::string> light_warnings(const DecodedImage& decoded);

// Sets NaN, infinite and negative values to 0 and counts them by kind.
PixelRepairs sanitise(Image& image);

// An exposure in stops, then the Khronos PBR neutral tone curve (Khronos Group 2024), then sRGB.
struct TonemapOptions {
  double exposure_stops = 0.0;  // each stop doubles; 0 leaves values as they are
};
struct Image8;
// For looking at, not for measuring: NaN and negative values show as 0. Three channels; four when
// the image has alpha, which is kept linear.
Image8 tonemap(const Image& image, const TonemapOptions& options);

}  // namespace lightkiln
