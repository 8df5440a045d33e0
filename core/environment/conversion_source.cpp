#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/environment/layout_convert.h"

namespace lightkiln {

namespace {

double mean_luminance(const ConversionSource& source) {
  double light = 0, omega = 0;
  for (int y = 0; y < source.layout.height; ++y) {
    for (int x = 0; x < source.layout.width; ++x) {
      if (!texel_has_direction(source.layout, x, y)) continue;
      const double weight = source.density(x, y);
      light += weight * luminance(to_double(source.image->rgb(x, y)));
      omega += weight;
    }
  }
  return omega > 0 ? light / omega : 0;
}

// The range of the values in 3 x 3 texels about (x, y), relative to the scale of their error.
double local_contrast(const ConversionSource& source, int x, int y) {
  double brightest = source.mean, range = 0;
  for (int c = 0; c < 3; ++c) {
    double low = 1e38, high = 0;
    for (int j = std::max(0, y - 1); j <= std::min(source.layout.height - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(source.layout.width - 1, x + 1); ++i) {
        const double value = double(source.image->at(i, j)[c]);
        low = std::min(low, value);
        high = std::max(high, value);
      }
    }
    brightest = std::max(brightest, high);
    range = std::max(range, high - low);
  }
  return brightest > 0 ? range / brightest : 0;
}

double mean_contrast(const ConversionSource& source) {
  constexpr int kSide = 64;  // looked at in as many rows and columns at the most
  const int rows = std::min(kSide, source.layout.height);
  const int columns = std::min(kSide, source.layout.width);
  double squares = 0, omega = 0;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int x = (2 * i + 1) * source.layout.width / (2 * columns);
      const int y = (2 * j + 1) * source.layout.height / (2 * rows);
      if (!texel_has_direction(source.layout, x, y)) continue;
      const double weight = source.density(x, y), contrast = local_contrast(source, x, y);
      squares += weight * contrast * contrast;
      omega += weight;
    }
  }
  return omega > 0 ? std::sqrt(squares / omega) : 0;
}

const MapLayout& checked(const MapLayout& layout, const Image& image) {
  check_source(layout, image);
  return layout;
}

}  // namespace

void check_source(const MapLayout& layout, const Image& image) {
  const char* fault = layout_fault(layout);
  if (fault == nullptr && (image.width != layout.width || image.height != layout.height)) {
    fault = "The image has another size than its layout.";
  }
  if (fault == nullptr && image.channels != 3) fault = "The image has no three channels.";
  if (fault != nullptr) throw Error(ErrorCode::invalid_input, fault);
}

ConversionSource::ConversionSource(const MapLayout& layout_, const Image& image_)
    : layout(checked(layout_, image_)), image(&image_), density(layout), blend(layout) {
  mean = mean_luminance(*this);
  contrast = mean_contrast(*this);
}

}  // namespace lightkiln
