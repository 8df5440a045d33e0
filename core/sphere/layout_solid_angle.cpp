// Solid angles of the texels of every layout (declared in map_layout.h).

#include <algorithm>
#include <cmath>

#include "core/sphere/cube_cross.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/octahedral_map.h"
#include "core/sphere/radial_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

// The part of [i, i + 1] that lies on the sphere, as shares of a side.
struct Interval {
  double from, to;
};
Interval texel_interval(const MapLayout& layout, int i, int count) {
  if (layout.convention == TexelConvention::half_texel) {
    return {static_cast<double>(i) / count, (i + 1.0) / count};
  }
  return {std::max(0.0, (i - 0.5) / (count - 1)), std::min(1.0, (i + 0.5) / (count - 1))};
}

// d(omega) = d(longitude) d(sin latitude), and the rows are equal steps of tan(latitude).
double cylinder_band(const MapLayout& layout, const Interval& rows) {
  const double top = kPi * layout.height / layout.width;
  const double upper = top * (1 - 2 * rows.from), lower = top * (1 - 2 * rows.to);
  return std::sin(std::atan(upper)) - std::sin(std::atan(lower));
}

double cube_layout_solid_angle(const MapLayout& layout, int x, int y) {
  const int size = cube_face_size(layout);
  if (face_at(layout.kind, x / size, y / size) < 0) return 0;
  const Interval s = texel_interval(layout, x % size, size);
  const Interval t = texel_interval(layout, y % size, size);
  return plane_solid_angle(2 * s.from - 1, 2 * s.to - 1, 2 * t.from - 1, 2 * t.to - 1);
}

}  // namespace

double texel_solid_angle(const MapLayout& layout, int x, int y) {
  if (is_cube(layout.kind)) return cube_layout_solid_angle(layout, x, y);
  const Interval u = texel_interval(layout, x, layout.width);
  const Interval v = texel_interval(layout, y, layout.height);
  const double right = 2 * u.from - 1, right_end = 2 * u.to - 1;
  switch (layout.kind) {
    case LayoutKind::latlong:
      return 2 * kPi * (u.to - u.from) * 2 * std::sin(kPi * (v.from + v.to) / 2) *
             std::sin(kPi * (v.to - v.from) / 2);
    case LayoutKind::cylinder:
      return 2 * kPi * (u.to - u.from) * cylinder_band(layout, v);
    case LayoutKind::cylinder_equal_area:
    case LayoutKind::equal_area_octahedral:
      return 4 * kPi * (u.to - u.from) * (v.to - v.from);
    case LayoutKind::octahedral:
      return octahedral_solid_angle(right, right_end, 2 * v.from - 1, 2 * v.to - 1);
    default:
      return radial_solid_angle(layout, right, right_end, 1 - 2 * v.to, 1 - 2 * v.from);
  }
}

double covered_solid_angle(const MapLayout& layout) {
  if (is_radial(layout.kind)) return cap_solid_angle(radial_limit(layout));
  if (layout.kind == LayoutKind::cylinder) {
    return 4 * kPi * std::sin(std::atan(kPi * layout.height / layout.width));
  }
  return 4 * kPi;
}

double solid_angle_density(const MapLayout& layout, double x, double y) {
  const bool borders = layout.convention == TexelConvention::openexr;
  const int columns = is_cube(layout.kind) ? cube_face_size(layout) : layout.width;
  const int rows = is_cube(layout.kind) ? columns : layout.height;
  // Shares of a side per texel.
  const double du = 1.0 / (borders ? columns - 1 : columns);
  const double dv = 1.0 / (borders ? rows - 1 : rows);
  const double left = is_cube(layout.kind) ? std::floor(x / columns) * columns : 0;
  const double top = is_cube(layout.kind) ? std::floor(y / rows) * rows : 0;
  const double u = (x - left - (borders ? 0.5 : 0)) * du;
  const double v = (y - top - (borders ? 0.5 : 0)) * dv;
  const double p = 2 * u - 1, q = 2 * v - 1;
  if (is_cube(layout.kind)) {
    const double square = 1 + p * p + q * q;
    return 4 * du * dv / (square * std::sqrt(square));
  }
  switch (layout.kind) {
    case LayoutKind::latlong:
      return 2 * kPi * kPi * du * dv * std::sin(kPi * std::clamp(v, 0.0, 1.0));
    case LayoutKind::cylinder: {
      const double slope = kPi * layout.height / layout.width, tangent = slope * q;
      return 4 * kPi * slope * du * dv / std::pow(1 + tangent * tangent, 1.5);
    }
    case LayoutKind::cylinder_equal_area:
    case LayoutKind::equal_area_octahedral:
      return 4 * kPi * du * dv;
    case LayoutKind::octahedral:
      return 4 * du * dv * octahedral_density(p, q);
    default:
      return 4 * du * dv * radial_density(layout, std::min(1.0, std::hypot(p, q)));
  }
}

}  // namespace lightkiln
