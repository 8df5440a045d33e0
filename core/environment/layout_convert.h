#pragma once

// From any layout to any other.

#include <cstdint>

#include "core/base/progress.h"
#include "core/environment/layout_sample.h"
#include "core/image/image.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"
#include "core/sphere/texel_density.h"

namespace lightkiln {

enum class MapFilter {
  // The mean of the source, as a function that is constant on each of its texels, over the solid
  // angle of the target's texel: the texel's outline is laid over the source's grid and every
  // texel below it counts with the exact area it shares. Keeps energy at any scale; enlarged, the
  // source's texels show as steps.
  area,
  // `area` where a texel of the target spans a texel of the source or more in every direction;
  // where it spans half of one or less in some direction, the mean of the interpolation between the
  // source's texels, which is continuous and never leaves the range of its neighbours (no ringing,
  // no negative value); in between, a mixture of both.
  adaptive
};

// Throws Error{invalid_input} when image and layout disagree, the layout is faulty, or the image
// has not three channels.
void check_source(const MapLayout& layout, const Image& image);

// An image to convert from, and what every conversion of it needs. Keeps a pointer to the image.
struct ConversionSource {
  // Throws as check_source() does.
  ConversionSource(const MapLayout& layout_, const Image& image_);

  MapLayout layout;
  const Image* image;  // 3 channels
  TexelDensity density;
  RowBlend blend;
  double mean = 0;  // luminance over what the layout covers
};

// Of an environment that is read, unless it is asked for more exactly.
inline constexpr double kConversionError = 1e-3;

// Texels are only moved: equal layouts, or cube layouts of one face size and convention, unturned.
bool moves_texels(const MapLayout& from, const MapLayout& to, const Rotation& rotation);

// What a conversion takes, for prices.
struct ConversionWork {
  double texels = 0;     // of the target
  double per_place = 1;  // what one costs, in those of a layout without discs
  double places = 0;     // looked up in the source
  double polygons = 0;   // laid over a grid; of eight edges twice
  double covered = 0;    // texels under them
  double points = 0;     // interpolated
  bool walked = false;   // in closed form, by resample_to_cube()
  int looked_at = 0;     // texels that this was estimated from
};
// Estimated from about a thousand texels, or a quarter of few.
ConversionWork estimate_conversion(const ConversionSource& source, const MapLayout& to,
                                   const Rotation& rotation, MapFilter filter, double error);

// `source` turned by `rotation`, as an image of layout `to`: the ideal of layout_truth.h. What the
// source does not cover is black; what the target does not show is 0. Between cube layouts of one
// face size and convention, or equal layouts, without rotation, texels are moved and nothing is
// computed. Border texels that repeat a direction (openexr) are equal to the bit. The same bits for
// any number of threads.
//
// `error`: the root mean square, over the texels of a target of 64 texels a side or more, of what
// they differ from the ideal by, relative to the mean of the source or to the brightest texel that
// a texel shows, whichever is more. Calibrated on white noise, which no picture is as hard as. A
// lower error cuts texels more finely where the light about them varies.
Image convert_layout(const ConversionSource& source, const MapLayout& to, const Rotation& rotation,
                     MapFilter filter, double error, int threads, Progress& progress);

// The same of a source that is converted once, to kConversionError. Throws Error{invalid_input}
// when an image and its layout disagree or a layout is faulty.
Image convert_layout(const MapLayout& from, const Image& source, const MapLayout& to,
                     const Rotation& rotation, MapFilter filter, int threads, Progress& progress);

}  // namespace lightkiln
