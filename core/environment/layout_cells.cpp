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

// What is left of the order for misplacing alone; a tighter order is nearer to the other errors.
double for_misplacing(double error) {
  constexpr double kTight = 3e-4;
  return error * (error < kTight ? 0.4 : 0.5);
}

void show(const ConversionTask& task, const Vec3d& direction, CellCorner* corner) {
  corner->shown = true;
  const std::optional<MapPlace> place =
      layout_place(task.source.layout, task.turned ? task.rotation.undo(direction) : direction);
  if (!place) return;
  corner->covered = true;
  corner->place = *place;
}

double distance(const GridPoint& a, const GridPoint& b) {
  return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
}

// The mean of opposite sides.
GridPoint first_side(const std::array<GridPoint, 4>& p) {
  return {0.5 * (p[1].x - p[0].x + p[2].x - p[3].x), 0.5 * (p[1].y - p[0].y + p[2].y - p[3].y)};
}
GridPoint second_side(const std::array<GridPoint, 4>& p) {
  return {0.5 * (p[3].x - p[0].x + p[2].x - p[1].x), 0.5 * (p[3].y - p[0].y + p[2].y - p[1].y)};
}

}  // namespace

bool by_pole(const ConversionTask& task, double y) {
  return task.turn > 0 && (y < task.reach || y > task.source.layout.height - task.reach);
}

ConversionTask make_conversion(const ConversionSource& source, const MapLayout& to,
                               const Rotation& rotation, MapFilter filter, double error) {
  const MapLayout& from = source.layout;
  ConversionTask task{
      source, to, rotation, filter, error, !rotation.is_identity(), turn_columns(from), 0,
      0,      0,  0,        0,      0};
  const double ratio = mean_pitch(to) / mean_pitch(from);
  task.seam_depth = std::clamp(static_cast<int>(std::ceil(std::log2(8 * ratio))), 1, 9);
  task.reach = static_cast<int>(std::clamp(std::ceil(1.5 * ratio), 1.0, 64.0)) + 1;
  constexpr double kStraight = 0.07;  // radians
  task.least = std::clamp(static_cast<int>(std::ceil(std::log2(mean_pitch(to) / kStraight))), 0, 6);
  // The edges of texels wider than 1.5 degrees bend enough to be looked at for a coarse order too.
  constexpr double kWide = 0.026;  // radians
  task.not_asked = mean_pitch(to) > kWide ? 0.05 : 0.004;
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
  corner.at = {x, y};
  show(task, *direction, &corner);
  return corner;
}

CellCorner locate(const ConversionTask& task, const RimPatch& patch, double a, double b) {
  const RimPoint point = rim_point(task.to, patch, a, b);
  CellCorner corner;
  corner.at = {point.x, point.y};
  show(task, point.direction, &corner);
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

// With sides P, Q in the target and A, B in the source, J (P Q) = (A B) gives the columns of J as
//   dq/dx = (A Q_y - B P_y) / d,  dq/dy = (B P_x - A Q_x) / d,  d = P_x Q_y - P_y Q_x.
// Its singular values' squares are the roots of z^2 - trace z + det^2; the smaller is |det| over
// the larger, without cancellation.
double smaller_span(GridPoint p, GridPoint q, GridPoint a, GridPoint b) {
  const double d = p.x * q.y - p.y * q.x;
  if (d == 0) return 0;
  const double xx = (a.x * q.y - b.x * p.y) / d, xy = (a.y * q.y - b.y * p.y) / d;
  const double yx = (b.x * p.x - a.x * q.x) / d, yy = (b.y * p.x - a.y * q.x) / d;
  const double trace = xx * xx + xy * xy + yx * yx + yy * yy, det = xx * yy - xy * yx;
  const double larger = 0.5 * (trace + std::sqrt(std::max(0.0, trace * trace - 4 * det * det)));
  return larger > 0 ? std::abs(det) / std::sqrt(larger) : 0;
}

double CellOutline::first_length() const {
  return std::max(distance(points[0], points[1]), distance(points[3], points[2]));
}
double CellOutline::second_length() const {
  return std::max(distance(points[0], points[3]), distance(points[1], points[2]));
}

bool CellOutline::skewed() const {
  constexpr double kSkewed = 0.1;
  const auto& p = points;
  const double x = p[0].x - p[1].x + p[2].x - p[3].x, y = p[0].y - p[1].y + p[2].y - p[3].y;
  const double longest = std::max(ax * ax + ay * ay, bx * bx + by * by);
  return x * x + y * y > kSkewed * kSkewed * longest;
}

bool CellOutline::slender() const {
  constexpr double kSlender = 0.2;
  const double longest = std::max(first_length(), second_length());
  return area < kSlender * longest * longest;
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
    found.target[i] = corners[i].at;
    if (task.turn > 0 && i > 0) {
      p[i].x -= task.turn * std::nearbyint((place.x - p[0].x) / task.turn);
    }
  }
  for (size_t i = 0; i < 4; ++i) {
    const GridPoint &a = p[i], &b = p[(i + 1) % 4];
    const double x = std::abs(a.x - b.x), y = std::abs(a.y - b.y);
    if (x > task.span_x && (by_pole(task, a.y) || by_pole(task, b.y))) return std::nullopt;
    found.wide = found.wide || x > task.span_x || y > task.span_y;
  }
  const GridPoint a = first_side(p), b = second_side(p);
  found.ax = a.x;
  found.ay = a.y;
  found.bx = b.x;
  found.by = b.y;
  found.area = std::abs(a.x * b.y - a.y * b.x);
  found.span = smaller_span(first_side(found.target), second_side(found.target), a, b);
  return found;
}

void ValueRange::add(const float* value) {
  for (int c = 0; c < 3; ++c) {
    low[c] = std::min(low[c], value[c]);
    high[c] = std::max(high[c], value[c]);
  }
}

double ValueRange::spread() const {
  double spread = 0;
  for (int c = 0; c < 3; ++c) spread = std::max(spread, double(high[c]) - double(low[c]));
  return spread;
}

namespace {

// The values of a rectangle of the source, which may lie across the seam.
void add_box(const ConversionTask& task, double low_x, double low_y, double high_x, double high_y,
             ValueRange* range) {
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

void add_values(const ConversionTask& task, const TargetCell& cell,
                const std::optional<CellOutline>& outline, ValueRange* range) {
  if (outline) {
    const auto& p = outline->points;
    add_box(task, std::min({p[0].x, p[1].x, p[2].x, p[3].x}) - 1,
            std::min({p[0].y, p[1].y, p[2].y, p[3].y}) - 1,
            std::max({p[0].x, p[1].x, p[2].x, p[3].x}) + 1,
            std::max({p[0].y, p[1].y, p[2].y, p[3].y}) + 1, range);
    return;
  }
  for (const CellCorner& corner : cell.corners) {
    // Beyond a horizon there is black.
    if (!corner.covered) {
      const float black[3] = {0, 0, 0};
      range->add(black);
      continue;
    }
    const double x = corner.place.x, y = corner.place.y, reach = task.reach;
    const double wide = by_pole(task, y) ? task.turn : reach;
    add_box(task, x - wide, y - reach, x + wide, y + reach, range);
  }
}

double allowed_misplacement(const ConversionTask& task, const ValueRange& range) {
  const double spread = range.spread();
  const double scale = std::max(task.source.mean, range.brightest());
  return spread > 0 ? std::min(1.0, for_misplacing(task.error) * scale / spread) : 1.0;
}

}  // namespace lightkiln
