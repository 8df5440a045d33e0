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

// The middle of that part, from the texel's centre.
double shown_middle(const MapLayout& layout, int i, int count) {
  if (shown_share(layout, i, count) == 1) return 0;
  return i == 0 ? 0.25 : -0.25;
}

}  // namespace

// Two Gauss points a side give the mean to the fourth order of a texel, and the slopes.
void TexelDensity::add(const MapLayout& layout, int x, int y, bool by_row, double mean) {
  const double half = 0.5 / std::sqrt(3.0);
  const int rows = is_cube(layout.kind) ? layout.width : layout.height;
  const double cx = shown_middle(layout, x, layout.width), cy = shown_middle(layout, y, rows);
  const double reach = half * (cx == 0 && cy == 0 ? 1 : 0.5);
  const auto at = [&](double dx, double dy) {
    return solid_angle_density(layout, x + 0.5 + cx + dx * reach, y + 0.5 + cy + dy * reach);
  };
  double along_x = 0, along_y = 0, sum = 0;
  if (by_row) {
    const double above = at(0, -1), below = at(0, 1);
    along_y = (below - above) / (2 * reach);
    sum = 0.5 * (above + below);
  } else {
    const double a = at(-1, -1), b = at(1, -1), c = at(-1, 1), d = at(1, 1);
    along_x = (b - a + d - c) / (4 * reach);
    along_y = (c - a + d - b) / (4 * reach);
    sum = 0.25 * (a + b + c + d);
  }
  const double exact = mean > 0 ? mean : sum;
  means_.push_back(static_cast<float>(exact));
  texels_.push_back({static_cast<float>(exact - along_x * cx - along_y * cy),
                     static_cast<float>(along_x), static_cast<float>(along_y)});
}

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
        add(strip, x, y, false, texel_solid_angle(strip, x, y) / shown);
      }
    }
    return;
  }
  rows_ = layout.height;
  columns_ = by_row ? 1 : layout.width;
  const size_t count = static_cast<size_t>(rows_) * static_cast<size_t>(columns_);
  means_.reserve(count);
  texels_.reserve(count);
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      if (by_row) {
        const int inner = std::min(1, layout.width - 1);
        add(layout, inner, y, true,
            texel_solid_angle(layout, inner, y) / shown_share(layout, y, rows_) /
                shown_share(layout, inner, layout.width));
      } else {
        add(layout, x, y, false, 0);
      }
    }
  }
}

}  // namespace lightkiln
