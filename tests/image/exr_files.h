#pragma once

// OpenEXR files of every kind that our own writer does not write, made with the library.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/image/primaries.h"

namespace lightkiln::test {

enum class ExrSamples { half, float32, uint32 };
enum class ExrStorage { scan_lines, tiles, mip_map, rip_map };

struct ExrRecipe {
  std::string compression = "zip";  // none rle zips zip piz pxr24 b44 b44a dwaa dwab
  ExrSamples samples = ExrSamples::half;
  ExrStorage storage = ExrStorage::scan_lines;
  int window_x = 0, window_y = 0;  // the data window's corner
  // Where it lies from the data window's corner, and its size; none = the data window.
  std::optional<PixelWindow> display;
  bool envmap_latlong = false;  // the attribute `envmap`
  bool decreasing_lines = false;
  bool second_part = false;  // a first part with channel Z only, the image in a second part
  std::vector<std::string> extra_channels;  // of the same samples, filled with 7
  std::optional<Primaries> primaries;
};

// Levels below the first of mip_map and rip_map are filled with 999.
std::vector<std::byte> make_exr(const Image& image, const ExrRecipe& recipe);

struct ChromaRecipe {
  std::string compression = "piz";
  int window_x = 0, window_y = 0;  // the data window's corner; both even
  // A first part with channel Z only, larger than the image, which stands in a second part.
  bool second_part = false;
};
// Y, RY and BY in 16-bit float, RY and BY at every second pixel. Even sides. The same samples in
// every packing that loses nothing.
std::vector<std::byte> make_luminance_chroma_exr(const Image& image,
                                                 const ChromaRecipe& recipe = {});

// A smooth ramp with a different slope per channel, values from 0.25 to about 5.
Image ramp(int width, int height, int channels);

}  // namespace lightkiln::test
