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
}

}  // namespace lightkiln
