#include "core/environment/source_layout.h"

#include <algorithm>

#include "core/base/error.h"

namespace lightkiln {

namespace {

constexpr int kWidestHolding = 8192;

[[noreturn]] void refuse(const Image& image, const std::string& why) {
  throw Error(ErrorCode::invalid_input, "The environment is " + std::to_string(image.width) +
                                            " x " + std::to_string(image.height) + " pixels; " +
                                            why);
}

LayoutKind named_by(EnvmapAttribute attribute) {
  return attribute == EnvmapAttribute::cube ? LayoutKind::cube_strip : LayoutKind::latlong;
}

}  // namespace

MapLayout source_layout(const DecodedImage& decoded, const SourceReading& reading) {
  const Image& image = decoded.image;
  MapLayout layout{.kind = reading.layout.value_or(named_by(decoded.envmap)),
                   .width = image.width,
                   .height = image.height,
                   .camera_distance = reading.camera_distance,
                   .mirrored = reading.mirrored};
  const bool attribute =
      decoded.envmap != EnvmapAttribute::none && named_by(decoded.envmap) == layout.kind;
  layout.convention = reading.convention.value_or(attribute ? TexelConvention::openexr
                                                            : TexelConvention::half_texel);
  const bool single = image.width == 1 && image.height == 1;
  if (layout.kind == LayoutKind::latlong && image.width != 2 * image.height && !single) {
    refuse(image,
           "a lat-long map covers the whole sphere and is exactly twice as wide as high. Other "
           "layouts are named by parameters.source.layout: cube_strip (N x 6N), horizontal_cross "
           "(4N x 3N), vertical_cross (3N x 4N), cylinder and cylinder_equal_area (an even number "
           "of texels wide), or one of the squares "
           "angular, mirror_ball, octahedral, equal_area_octahedral, hemisphere, "
           "hemisphere_equal_area.");
  }
  if (const char* fault = layout_fault(layout)) {
    refuse(image, std::string("it is read as ") + layout_name(layout.kind) + ". " + fault);
  }
  return layout;
}

int holding_width(const MapLayout& layout, bool turned) {
  const bool shifted = turned || layout.convention == TexelConvention::openexr;
  int width = 0;
  switch (layout.kind) {
    case LayoutKind::latlong:
      width = layout.width * (shifted && layout.width > 1 ? 2 : 1);
      break;
    case LayoutKind::cylinder:
    case LayoutKind::cylinder_equal_area:
      width = 2 * layout.width;
      break;
    case LayoutKind::angular:
    case LayoutKind::mirror_ball:
      width = 2 * layout.width;
      break;
    default:
      width = is_cube(layout.kind) ? 8 * cube_face_size(layout) : 4 * layout.width;
      break;
  }
  const int own = layout.kind == LayoutKind::latlong ? layout.width : 0;
  return std::min(width, std::max(kWidestHolding, own));
}

}  // namespace lightkiln
