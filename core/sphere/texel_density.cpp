#include "core/sphere/texel_density.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

namespace {

// The share of a texel that lies on the sphere: half at the borders of the openexr convention.
double shown_share(const MapLayout& layout, int i, int count) {
  if (layout.convention == TexelConvention::half_texel) return 1;
  return i == 0 || i == count - 1 ? 0.5 : 1;
}

}  // namespace

TexelDensity::TexelDensity(const MapLayout& layout) {
  const bool by_row = layout.kind == LayoutKind::latlong || layout.kind == LayoutKind::cylinder ||
                      layout.kind == LayoutKind::cylinder_equal_area ||
                      layout.kind == LayoutKind::equal_area_octahedral;
  if (is_cube(layout.kind)) {
    // The first face of a cross may be an empty square; a strip has the same faces.
    MapLayout strip = make_layout(LayoutKind::cube_strip, cube_face_size(layout));
    strip.convention = layout.convention;
    columns_ = rows_ = strip.width;
    for (int y = 0; y < rows_; ++y) {
      for (int x = 0; x < columns_; ++x) {
        const double shown = shown_share(strip, x, columns_) * shown_share(strip, y, rows_);
        values_.push_back(static_cast<float>(texel_solid_angle(strip, x, y) / shown));
      }
    }
    return;
  }
  rows_ = layout.height;
  columns_ = by_row ? 1 : layout.width;
  values_.reserve(static_cast<size_t>(rows_) * static_cast<size_t>(columns_));
  // Two Gauss points a side are exact to the fourth order of a texel.
  const double half = 0.5 / std::sqrt(3.0);
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      double value = 0;
      if (by_row) {
        const int inner = std::min(1, layout.width - 1);
        value = texel_solid_angle(layout, inner, y) / shown_share(layout, y, rows_) /
                shown_share(layout, inner, layout.width);
      } else if (texel_has_direction(layout, x, y)) {
        for (const double dx : {-half, half}) {
          for (const double dy : {-half, half}) {
            value += 0.25 * solid_angle_density(layout, x + 0.5 + dx, y + 0.5 + dy);
          }
        }
      }
      values_.push_back(static_cast<float>(value));
    }
  }
}

}  // namespace lightkiln
