#pragma once

// Pixels in memory: linear, 32-bit float, interleaved, top row first.

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;           // 1 (Y), 3 (R, G, B) or 4 (R, G, B, A)
  std::vector<float> pixels;  // [(y * width + x) * channels + channel]

  Image() = default;
  Image(int width_, int height_, int channels_)
      : width(width_),
        height(height_),
        channels(channels_),
        pixels(static_cast<size_t>(width_) * static_cast<size_t>(height_) *
               static_cast<size_t>(channels_)) {}

  size_t offset(int x, int y) const {
    assert(x >= 0 && x < width && y >= 0 && y < height);
    return (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)) *
           static_cast<size_t>(channels);
  }
  float* at(int x, int y) { return pixels.data() + offset(x, y); }
  const float* at(int x, int y) const { return pixels.data() + offset(x, y); }
  Vec3 rgb(int x, int y) const {
    const float* p = at(x, y);
    return channels >= 3 ? Vec3{p[0], p[1], p[2]} : Vec3{p[0], p[0], p[0]};
  }
};

// What any reader or writer accepts.
inline constexpr int kMaxImageSide = 16384;
inline constexpr int64_t kMaxImagePixels = 67'108'864;

// Throws Error: too_large above the limits, invalid_input below 1 x 1. `what` begins the sentence,
// e.g. "An OpenEXR image".
void check_image_size(int64_t width, int64_t height, const std::string& what);

// Text taken from a file, fit for a message: bytes other than printable ASCII become '?', and what
// is longer than 200 characters is cut.
std::string printable(std::string text);

// What was repaired while reading, counted by kind. Nothing is repaired silently.
struct PixelRepairs {
  uint64_t nan = 0;       // set to 0
  uint64_t infinite = 0;  // set to 0
  uint64_t negative = 0;  // set to 0
};

// The layout a file claims through OpenEXR's `envmap` attribute.
enum class EnvmapAttribute { none, latlong, cube };

// A rectangle of pixels, in pixels of the image that it belongs to: (0, 0) is its upper left one.
struct PixelWindow {
  int64_t x = 0, y = 0;
  int64_t width = 0, height = 0;
};

struct DecodedImage {
  Image image;                                     // linear Rec. 709, 1 or 3 channels
  EnvmapAttribute envmap = EnvmapAttribute::none;  // what the file says of its layout
  std::string format;                              // "OpenEXR, 32-bit float, ZIP", for reports
  // OpenEXR's display window, when it is not the image itself (the data window).
  std::optional<PixelWindow> display;
  bool display_referred = false;  // made for a screen: nothing is brighter than 1
  // Set by frame_as_displayed().
  uint64_t pixels_missing = 0;  // of the display window, that the file does not hold: black
  uint64_t pixels_outside = 0;  // of the file, outside its display window: dropped
};

}  // namespace lightkiln
