#include "core/sphere/map_layout.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sphere/cube_cross.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/octahedral_map.h"
#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

bool is_octahedral(LayoutKind kind) {
  return kind == LayoutKind::octahedral || kind == LayoutKind::equal_area_octahedral;
}
bool is_cylinder(LayoutKind kind) {
  return kind == LayoutKind::cylinder || kind == LayoutKind::cylinder_equal_area;
}
bool on_borders(const MapLayout& layout) {
  return layout.convention == TexelConvention::openexr;
}

// Between a texel coordinate and the share [0, 1] of a side with `count` texels.
double share_of(const MapLayout& layout, double x, int count) {
  return on_borders(layout) ? (x - 0.5) / (count - 1) : x / count;
}
double coordinate_of(const MapLayout& layout, double share, int count) {
  return on_borders(layout) ? share * (count - 1) + 0.5 : share * count;
}

// tan(latitude) at the upper border of a cylinder of radius 1: W texels are 2 pi, so H are
// 2 pi H / W.
double cylinder_top(const MapLayout& layout) {
  return kPi * layout.height / layout.width;
}

// The row's share v of a cylinder is linear in its height: tan(latitude), or sin(latitude) on the
// equal-area one.
Vec3d cylinder_direction(const MapLayout& layout, double u, double v) {
  const double longitude = kPi * (1 - 2 * u);
  const double height = 1 - 2 * v;
  if (layout.kind == LayoutKind::cylinder_equal_area) {
    // cos(latitude) = sqrt((1 - h)(1 + h)) = 2 sqrt(v (1 - v)) keeps its digits at the poles.
    const double across = 2 * std::sqrt(std::max(0.0, v * (1 - v)));
    return normalize(Vec3d{across * std::sin(longitude), height, across * std::cos(longitude)});
  }
  return normalize(Vec3d{std::sin(longitude), height * cylinder_top(layout), std::cos(longitude)});
}

std::optional<double> cylinder_row_share(const MapLayout& layout, const Vec3d& d) {
  const double across = std::hypot(d.x, d.z);
  if (layout.kind == LayoutKind::cylinder_equal_area) {
    // (1 - y)/2 near the lower pole, across^2 / (2 (1 + |y|)) near the upper one.
    const double near = across * across / (2 * (1 + std::abs(d.y)));
    return d.y >= 0 ? near : 1 - near;
  }
  const double top = cylinder_top(layout);
  if (std::abs(d.y) > across * top * (1 + 1e-15)) return std::nullopt;
  return std::clamp(0.5 - 0.5 * d.y / (across * top), 0.0, 1.0);
}

std::optional<Vec3d> cube_layout_direction(const MapLayout& layout, double x, double y) {
  const int size = cube_face_size(layout);
  const int columns = layout.width / size, rows = layout.height / size;
  const int column = std::clamp(static_cast<int>(x / size), 0, columns - 1);
  const int row = std::clamp(static_cast<int>(y / size), 0, rows - 1);
  const int face = face_at(layout.kind, column, row);
  if (face < 0) return std::nullopt;
  double s = share_of(layout, x - column * size, size);
  double t = share_of(layout, y - row * size, size);
  if (face_place(layout.kind, face).half_turn) {
    s = 1 - s;
    t = 1 - t;
  }
  return cube_direction(face, s, t);
}

MapPlace cube_layout_place(const MapLayout& layout, const Vec3d& direction) {
  int face = 0;
  double s = 0, t = 0;
  cube_coordinates(direction, &face, &s, &t);
  const FacePlace place = face_place(layout.kind, face);
  if (place.half_turn) {
    s = 1 - s;
    t = 1 - t;
  }
  const int size = cube_face_size(layout);
  // Borders belong to the face on their own side.
  const auto inside = [&](int square, double share) {
    const double end = (square + 1.0) * size;
    return std::min(square * size + coordinate_of(layout, share, size), std::nextafter(end, 0.0));
  };
  return {inside(place.column, s), inside(place.row, t), face + 1};
}

constexpr std::array<const char*, 12> kNames = {"latlong",          "cube_strip",
                                                "horizontal_cross", "vertical_cross",
                                                "angular",          "mirror_ball",
                                                "octahedral",       "equal_area_octahedral",
                                                "hemisphere",       "hemisphere_equal_area",
                                                "cylinder",         "cylinder_equal_area"};

}  // namespace

const char* layout_name(LayoutKind kind) {
  return kNames[static_cast<size_t>(kind)];
}

const char* layout_fault(const MapLayout& layout) {
  const int w = layout.width, h = layout.height;
  if (w < 1 || h < 1) return "An image has at least one texel a side.";
  const bool borders_allowed =
      layout.kind == LayoutKind::latlong || layout.kind == LayoutKind::cube_strip;
  if (on_borders(layout) && !borders_allowed) {
    return "Texel centres on the borders (openexr) exist for lat-long maps and cube strips only.";
  }
  if (on_borders(layout) && (w < 2 || h < 2)) {
    return "Texel centres on the borders (openexr) need at least two texels a side.";
  }
  if (layout.camera_distance != 0 && !(layout.camera_distance > 1)) {
    return "The camera stands outside the ball: its distance is above 1 radius.";
  }
  switch (layout.kind) {
    case LayoutKind::latlong:
      if (w % 2 != 0 && w != 1) return "A lat-long map is an even number of texels wide.";
      return nullptr;
    case LayoutKind::cube_strip:
      return h == 6 * w ? nullptr : "A cube strip is N x 6N texels.";
    case LayoutKind::horizontal_cross:
      return w % 4 == 0 && h == w / 4 * 3 ? nullptr : "A horizontal cross is 4N x 3N texels.";
    case LayoutKind::vertical_cross:
      return w % 3 == 0 && h == w / 3 * 4 ? nullptr : "A vertical cross is 3N x 4N texels.";
    case LayoutKind::cylinder:
    case LayoutKind::cylinder_equal_area:
      return w % 2 == 0 ? nullptr : "A cylinder is an even number of texels wide.";
    default:
      return w == h ? nullptr : "This layout is square, N x N texels.";
  }
}

MapLayout make_layout(LayoutKind kind, int size) {
  MapLayout layout{.kind = kind, .width = size, .height = size};
  switch (kind) {
    case LayoutKind::latlong:
    case LayoutKind::cylinder:
    case LayoutKind::cylinder_equal_area:
      layout.height = std::max(1, size / 2);
      break;
    case LayoutKind::cube_strip:
      layout.height = 6 * size;
      break;
    case LayoutKind::horizontal_cross:
      layout.width = 4 * size;
      layout.height = 3 * size;
      break;
    case LayoutKind::vertical_cross:
      layout.width = 3 * size;
      layout.height = 4 * size;
      break;
    default:
      break;
  }
  return layout;
}

bool is_cube(LayoutKind kind) {
  return kind == LayoutKind::cube_strip || kind == LayoutKind::horizontal_cross ||
         kind == LayoutKind::vertical_cross;
}

int cube_face_size(const MapLayout& layout) {
  if (layout.kind == LayoutKind::horizontal_cross) return layout.width / 4;
  return layout.kind == LayoutKind::vertical_cross ? layout.width / 3 : layout.width;
}

int turn_columns(const MapLayout& layout) {
  if (layout.kind != LayoutKind::latlong && !is_cylinder(layout.kind)) return 0;
  return on_borders(layout) ? layout.width - 1 : layout.width;
}

std::optional<Vec3d> layout_direction(const MapLayout& layout, double x, double y) {
  if (is_cube(layout.kind)) return cube_layout_direction(layout, x, y);
  const double u = share_of(layout, x, layout.width), v = share_of(layout, y, layout.height);
  if (layout.kind == LayoutKind::latlong) return latlong_direction(u, v);
  if (is_cylinder(layout.kind)) return cylinder_direction(layout, u, v);
  if (layout.kind == LayoutKind::octahedral) return octahedral_direction(2 * u - 1, 2 * v - 1);
  if (layout.kind == LayoutKind::equal_area_octahedral) {
    return equal_area_direction(2 * u - 1, 2 * v - 1);
  }
  const double right = 2 * u - 1, up = 1 - 2 * v;
  if (std::hypot(right, up) > 1 + 1e-15) return std::nullopt;
  return radial_direction(layout, right, up);
}

std::optional<MapPlace> layout_place(const MapLayout& layout, const Vec3d& direction) {
  if (is_cube(layout.kind)) return cube_layout_place(layout, direction);
  double u = 0, v = 0;
  int chart = 0;
  if (layout.kind == LayoutKind::latlong) {
    latlong_coordinates(direction, &u, &v);
  } else if (is_cylinder(layout.kind)) {
    const std::optional<double> row = cylinder_row_share(layout, direction);
    if (!row) return std::nullopt;
    latlong_coordinates(direction, &u, &v);
    v = *row;
  } else {
    double x = 0, y = 0;
    if (is_octahedral(layout.kind)) {
      const bool equal = layout.kind == LayoutKind::equal_area_octahedral;
      (equal ? equal_area_coordinates : octahedral_coordinates)(direction, &x, &y);
      chart = octahedral_corner(direction);
    } else {
      if (!radial_coordinates(layout, direction, &x, &y)) return std::nullopt;
      y = -y;
    }
    u = 0.5 * (1 + x);
    v = 0.5 * (1 + y);
  }
  return MapPlace{coordinate_of(layout, u, layout.width), coordinate_of(layout, v, layout.height),
                  chart};
}

bool layout_covers(const MapLayout& layout, const Vec3d& direction) {
  return layout_place(layout, direction).has_value();
}

bool texel_has_direction(const MapLayout& layout, int x, int y) {
  if (is_cube(layout.kind)) {
    const int size = cube_face_size(layout);
    return face_at(layout.kind, x / size, y / size) >= 0;
  }
  if (!is_radial(layout.kind)) return true;
  const double right = (2 * x + 1.0) / layout.width - 1, down = (2 * y + 1.0) / layout.height - 1;
  return right * right + down * down <= 1;
}

namespace {

// One texel past a pole lies half a turn further in the pole's own row.
bool continue_over_poles(const MapLayout& layout, int* x, int* y) {
  const bool beyond = *y < 0 || *y >= layout.height;
  if (beyond) *x += layout.width / 2;
  *y = *y < 0 ? -1 - *y : *y >= layout.height ? 2 * layout.height - 1 - *y : *y;
  *x = (*x % layout.width + layout.width) % layout.width;
  return true;
}

// Beyond an edge of the face the neighbouring face's border texel continues it; both faces have
// equal spacings along their common edge, so that rounding finds the texel opposite.
bool continue_cube(const MapLayout& layout, int chart, int* x, int* y) {
  const int size = cube_face_size(layout);
  const FacePlace place = face_place(layout.kind, chart - 1);
  int i = *x - place.column * size, j = *y - place.row * size;
  const bool outside_x = i < 0 || i >= size, outside_y = j < 0 || j >= size;
  if (!outside_x && !outside_y) return true;
  if (outside_x && outside_y) return false;
  double s = (i + 0.5) / size, t = (j + 0.5) / size;
  if (place.half_turn) {
    s = 1 - s;
    t = 1 - t;
  }
  const MapPlace next = cube_layout_place(layout, cube_direction(chart - 1, s, t));
  const FacePlace there = face_place(layout.kind, next.chart - 1);
  *x = std::clamp(static_cast<int>(next.x), there.column * size, (there.column + 1) * size - 1);
  *y = std::clamp(static_cast<int>(next.y), there.row * size, (there.row + 1) * size - 1);
  return true;
}

// The square's border meets itself folded about the middle of each side.
bool continue_octahedral(int size, int* x, int* y) {
  if (*x < 0 || *x >= size) {
    *x = *x < 0 ? -1 - *x : 2 * size - 1 - *x;
    *y = size - 1 - *y;
  }
  if (*y < 0 || *y >= size) {
    *y = *y < 0 ? -1 - *y : 2 * size - 1 - *y;
    *x = size - 1 - *x;
  }
  return true;
}

}  // namespace

bool continue_texel(const MapLayout& layout, int chart, int* x, int* y) {
  if (on_borders(layout)) {
    // Border texels repeat what lies across; nothing outside has any weight.
    const int size = is_cube(layout.kind) ? layout.width : layout.height;
    const int top = is_cube(layout.kind) ? (chart - 1) * size : 0;
    *x = std::clamp(*x, 0, layout.width - 1);
    *y = std::clamp(*y, top, top + size - 1);
    return true;
  }
  if (is_cube(layout.kind)) return continue_cube(layout, chart, x, y);
  if (is_octahedral(layout.kind)) return continue_octahedral(layout.width, x, y);
  if (is_radial(layout.kind)) {
    return *x >= 0 && *y >= 0 && *x < layout.width && *y < layout.height &&
           texel_has_direction(layout, *x, *y);
  }
  if (layout.kind == LayoutKind::cylinder) {
    *x = (*x % layout.width + layout.width) % layout.width;
    return *y >= 0 && *y < layout.height;
  }
  return continue_over_poles(layout, x, y);
}

}  // namespace lightkiln
