// Texels of the target and where their corners lie in the source (declared in layout_gather.h).

#include <algorithm>
#include <cmath>

#include "core/environment/layout_gather.h"

namespace lightkiln {

namespace {

double mean_pitch(const MapLayout& layout) {
  const int size = is_cube(layout.kind) ? cube_face_size(layout) : 0;
  const double texels = size > 0 ? 6.0 * size * size : 1.0 * layout.width * layout.height;
  return std::sqrt(covered_solid_angle(layout) / texels);
}

// What is kept of the order for everything else that errs.
constexpr double kSpare = 0.5;

// The range of values over a rectangle of the source, and the brightest of them.
struct ValueRange {
  float low[3] = {1e38f, 1e38f, 1e38f}, high[3] = {0, 0, 0};

  void add(const float* value) {
    for (int c = 0; c < 3; ++c) {
      low[c] = std::min(low[c], value[c]);
      high[c] = std::max(high[c], value[c]);
    }
  }
  double brightest() const { return double(std::max({high[0], high[1], high[2]})); }
  double spread() const {
    double spread = 0;
    for (int c = 0; c < 3; ++c) spread = std::max(spread, double(high[c]) - double(low[c]));
    return spread;
  }
};

double smaller_extent(double ax, double ay, double bx, double by) {
  const double trace = ax * ax + ay * ay + bx * bx + by * by, area = ax * by - ay * bx;
  const double root = std::sqrt(std::max(0.0, trace * trace - 4 * area * area));
  return std::sqrt(std::max(0.0, (trace - root) / 2));
}

}  // namespace

ConversionTask make_conversion(const ConversionSource& source, const MapLayout& to,
                               const Rotation& rotation, MapFilter filter, double error) {
  const MapLayout& from = source.layout;
  ConversionTask task{
      source, to, rotation, filter, error, !rotation.is_identity(), turn_columns(from),
      0,      0,  0,        0,      0};
  const double ratio = mean_pitch(to) / mean_pitch(from);
  task.seam_depth = std::clamp(static_cast<int>(std::ceil(std::log2(8 * ratio))), 1, 9);
  task.reach = static_cast<int>(std::clamp(std::ceil(1.5 * ratio), 1.0, 64.0)) + 1;
  constexpr double kStraight = 0.07;  // radians
  task.least = std::clamp(static_cast<int>(std::ceil(std::log2(mean_pitch(to) / kStraight))), 0, 6);
  // Straight edges: within 1/48 of a turn along rows, 1/96 of the sphere's half turn otherwise.
  const int size = is_cube(from.kind) ? cube_face_size(from) : from.height;
  task.span_y = std::max(4.0, size / (is_cube(from.kind) ? 24.0 : 96.0));
  task.span_x = task.turn > 0 ? std::max(4.0, from.width / 48.0) : task.span_y;
  return task;
}

CellCorner locate(const ConversionTask& task, double x, double y) {
  CellCorner corner;
  const std::optional<Vec3d> direction = layout_direction(task.to, x, y);
  if (!direction) return corner;
  corner.shown = true;
  const std::optional<MapPlace> place =
      layout_place(task.source.layout, task.turned ? task.rotation.undo(*direction) : *direction);
  if (!place) return corner;
  corner.covered = true;
  corner.place = *place;
  return corner;
}

TargetCell locate_corners(const ConversionTask& task, TargetCell cell) {
  cell.corners = {locate(task, cell.x0, cell.y0), locate(task, cell.x1, cell.y0),
                  locate(task, cell.x1, cell.y1), locate(task, cell.x0, cell.y1)};
  return cell;
}

TargetBlock block_of(const MapLayout& layout, int x, int y) {
  if (!is_cube(layout.kind)) return {0, 0, layout.width, layout.height};
  const int size = cube_face_size(layout);
  return {x / size * size, y / size * size, size, size};
}

double grid_line(const MapLayout& layout, int line, int start, int count) {
  const double margin = layout.convention == TexelConvention::openexr ? 0.5 : 0.0;
  return std::clamp(static_cast<double>(line), start + margin + 1e-9,
                    start + count - margin - 1e-9);
}

TargetCell texel_cell(const MapLayout& layout, const TargetBlock& block, int x, int y,
                      const std::array<CellCorner, 4>& corners) {
  return {grid_line(layout, x, block.x, block.columns), grid_line(layout, y, block.y, block.rows),
          grid_line(layout, x + 1, block.x, block.columns),
          grid_line(layout, y + 1, block.y, block.rows), corners};
}

double CellOutline::smaller_at(size_t i) const {
  const GridPoint &p = points[i], &next = points[(i + 1) % 4], &last = points[(i + 3) % 4];
  return smaller_extent(next.x - p.x, next.y - p.y, last.x - p.x, last.y - p.y);
}

std::optional<CellOutline> outline_of(const ConversionTask& task,
                                      const std::array<CellCorner, 4>& corners) {
  CellOutline found;
  auto& p = found.points;
  for (size_t i = 0; i < 4; ++i) {
    if (!corners[i].shown || !corners[i].covered) return std::nullopt;
    const MapPlace& place = corners[i].place;
    if (place.chart != 0) {
      if (found.chart != 0 && found.chart != place.chart) return std::nullopt;
      found.chart = place.chart;
    }
    p[i] = {place.x, place.y};
    if (task.turn > 0 && i > 0) {
      p[i].x -= task.turn * std::nearbyint((place.x - p[0].x) / task.turn);
    }
  }
  for (size_t i = 0; i < 4; ++i) {
    const GridPoint &a = p[i], &b = p[(i + 1) % 4];
    if (std::abs(a.x - b.x) > task.span_x || std::abs(a.y - b.y) > task.span_y) return std::nullopt;
  }
  found.ax = 0.5 * (p[1].x - p[0].x + p[2].x - p[3].x);
  found.ay = 0.5 * (p[1].y - p[0].y + p[2].y - p[3].y);
  found.bx = 0.5 * (p[3].x - p[0].x + p[2].x - p[1].x);
  found.by = 0.5 * (p[3].y - p[0].y + p[2].y - p[1].y);
  found.area = std::abs(found.ax * found.by - found.ay * found.bx);
  found.smaller = smaller_extent(found.ax, found.ay, found.bx, found.by);
  return found;
}

namespace {

// The values of a rectangle of the source, which may lie across the seam.
void add_values(const ConversionTask& task, double low_x, double low_y, double high_x,
                double high_y, ValueRange* range) {
  const MapLayout& from = task.source.layout;
  const int top = std::max(0, static_cast<int>(low_y));
  const int bottom = std::min(from.height - 1, static_cast<int>(high_y));
  int left = static_cast<int>(std::floor(low_x)), right = static_cast<int>(std::floor(high_x));
  if (task.turn == 0) {
    left = std::max(0, left);
    right = std::min(from.width - 1, right);
  } else {
    right = std::min(right, left + task.turn - 1);
  }
  for (int y = top; y <= bottom; ++y) {
    int column = task.turn > 0 ? ((left % task.turn) + task.turn) % task.turn : left;
    for (int x = left; x <= right; ++x) {
      range->add(task.source.image->at(column, y));
      if (++column == task.turn) column = 0;
    }
  }
}

}  // namespace

double allowed_misplacement(const ConversionTask& task, const TargetCell& cell,
                            const std::optional<CellOutline>& outline) {
  ValueRange range;
  if (outline) {
    const auto& p = outline->points;
    add_values(task, std::min({p[0].x, p[1].x, p[2].x, p[3].x}) - 1,
               std::min({p[0].y, p[1].y, p[2].y, p[3].y}) - 1,
               std::max({p[0].x, p[1].x, p[2].x, p[3].x}) + 1,
               std::max({p[0].y, p[1].y, p[2].y, p[3].y}) + 1, &range);
  } else {
    for (const CellCorner& corner : cell.corners) {
      // Beyond a horizon there is black.
      if (!corner.covered) {
        const float black[3] = {0, 0, 0};
        range.add(black);
        continue;
      }
      // About a pole a few texels are the whole turn.
      const double x = corner.place.x, y = corner.place.y, reach = task.reach;
      const bool pole = task.turn > 0 && (y < reach || y > task.source.layout.height - reach);
      const double wide = pole ? task.turn : reach;
      add_values(task, x - wide, y - reach, x + wide, y + reach, &range);
    }
  }
  const double spread = range.spread();
  const double scale = std::max(task.source.mean, range.brightest());
  return spread > 0 ? std::min(1.0, kSpare * task.error * scale / spread) : 1.0;
}

}  // namespace lightkiln
