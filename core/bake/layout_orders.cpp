#include "core/bake/layout_orders.h"

#include <algorithm>

namespace lightkiln {

SourceReading reading_of(const SourceParameters& parameters) {
  return {parameters.layout,   parameters.texel_convention, parameters.distance.value_or(0),
          parameters.mirrored, parameters.face_orientation, parameters.strict};
}

Rotation rotation_of(const RotationParameters& parameters) {
  if (parameters.yaw_degrees != 0) return yaw_rotation(parameters.yaw_degrees);
  const std::vector<double>& q = parameters.quaternion;
  return quaternion_rotation(q.at(0), q.at(1), q.at(2), q.at(3));
}

const char* layout_product_name(size_t product) {
  return product == kCubeFaces ? "cube_faces" : layout_name(static_cast<LayoutKind>(product));
}

LayoutOutput default_layout_output(size_t product) {
  const LayoutKind kind = static_cast<LayoutKind>(product);
  LayoutOutput output;
  const bool wide =
      product != kCubeFaces && (kind == LayoutKind::latlong || kind == LayoutKind::cylinder ||
                                kind == LayoutKind::cylinder_equal_area);
  output.size = wide ? 1024 : product == kCubeFaces || is_cube(kind) ? 256 : 512;
  return output;
}

MapLayout layout_of(size_t product, const LayoutOutput& output) {
  const LayoutKind kind =
      product == kCubeFaces ? LayoutKind::cube_strip : static_cast<LayoutKind>(product);
  MapLayout layout = make_layout(kind, output.size);
  if (output.height) layout.height = *output.height;
  layout.convention = output.texel_convention;
  layout.camera_distance = output.distance.value_or(0);
  layout.mirrored = output.mirrored;
  return layout;
}

}  // namespace lightkiln
