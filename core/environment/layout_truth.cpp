// Lines run over the texel in the direction that is oblique in the source, so that none of its
// borders lies along them: what a line gives then changes without jumps from one line to the next,
// and equal steps between lines are of second order. Along a line g jumps where it passes from one
// texel of the source to another; these places are found by bisection and the pieces between them,
// smooth, are integrated by two Gauss points.

#include "core/environment/layout_truth.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/environment/layout_sample.h"

namespace lightkiln {

namespace {

constexpr int kNotShown = -2, kNotCovered = -1;  // instead of a texel of the source

struct Line {
  double x, y;    // where it enters
  double dx, dy;  // a unit step
  double length;

  double at_x(double t) const { return x + t * dx; }
  double at_y(double t) const { return y + t * dy; }
};

struct Rectangle {
  double x0, y0, x1, y1;
};

struct Conversion {
  const MapLayout& from;
  const Image& source;
  const MapLayout& to;
  const Rotation& rotation;
  bool adaptive;
  RowBlend blend;

  std::optional<MapPlace> place(double x, double y) const {
    const std::optional<Vec3d> d = layout_direction(to, x, y);
    return d ? layout_place(from, rotation.undo(*d)) : std::nullopt;
  }

  // Which piece of g a point belongs to.
  int piece(double x, double y) const {
    const std::optional<Vec3d> d = layout_direction(to, x, y);
    if (!d) return kNotShown;
    const std::optional<MapPlace> q = layout_place(from, rotation.undo(*d));
    if (!q) return kNotCovered;
    const int column = std::clamp(static_cast<int>(q->x), 0, from.width - 1);
    return std::clamp(static_cast<int>(q->y), 0, from.height - 1) * from.width + column;
  }

  // dq/dx or dq/dy, from both sides or from the one that lies on the same chart.
  bool derivative(double x, double y, double dx, double dy, double* along, double* down) const {
    constexpr double kStep = 1e-5;
    const std::optional<MapPlace> here = place(x, y);
    int sides = 0;
    *along = *down = 0;
    for (const double step : {kStep, -kStep}) {
      const std::optional<MapPlace> there = place(x + step * dx, y + step * dy);
      if (!here || !there || there->chart != here->chart) continue;
      double change = there->x - here->x;
      if (const int turn = turn_columns(from)) change -= turn * std::nearbyint(change / turn);
      *along += change / step;
      *down += (there->y - here->y) / step;
      ++sides;
    }
    if (sides == 2) {
      *along /= 2;
      *down /= 2;
    }
    return sides > 0;
  }

  double smooth_share(double x, double y) const {
    if (!adaptive) return 0;
    double ax = 0, ay = 0, bx = 0, by = 0;
    if (!derivative(x, y, 1, 0, &ax, &ay) || !derivative(x, y, 0, 1, &bx, &by)) return 1;
    // The singular values' squares are the roots of z^2 - trace z + det^2.
    const double trace = ax * ax + ay * ay + bx * bx + by * by, det = ax * by - ay * bx;
    const double larger = 0.5 * (trace + std::sqrt(std::max(0.0, trace * trace - 4 * det * det)));
    const double smaller = larger > 0 ? std::abs(det) / std::sqrt(larger) : 0;
    return std::clamp(2 - 2 * smaller, 0.0, 1.0);
  }

  Vec3d value(double x, double y, double* brightest) const {
    const std::optional<MapPlace> q = place(x, y);
    if (!q) return {};
    const double share = smooth_share(x, y);
    const Vec3d held = nearest_radiance(from, source, *q);
    *brightest = std::max({*brightest, held.x, held.y, held.z});
    if (share <= 0) return held;
    return held * (1 - share) + smooth_radiance(from, source, *q, blend) * share;
  }
};

struct Sums {
  Vec3d energy;
  double omega = 0, brightest = 0;
};

void add_piece(const Conversion& conversion, const Line& line, double from, double to,
               double weight, Sums* sums) {
  const double node = 0.5 / std::sqrt(3.0);
  for (const double offset : {0.5 - node, 0.5 + node}) {
    const double t = from + offset * (to - from);
    const double x = line.at_x(t), y = line.at_y(t);
    const double omega = 0.5 * (to - from) * weight * solid_angle_density(conversion.to, x, y);
    sums->energy += conversion.value(x, y, &sums->brightest) * omega;
    sums->omega += omega;
  }
}

// From one step to the next, split wherever the piece changes.
void add_step(const Conversion& conversion, const Line& line, double from, double to, int piece,
              int end_piece, double weight, Sums* sums) {
  while (piece != end_piece) {
    double before = from, after = to;
    int next = end_piece;
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (before + after);
      const int found = conversion.piece(line.at_x(middle), line.at_y(middle));
      if (found == piece) {
        before = middle;
      } else {
        after = middle;
        next = found;
      }
    }
    if (piece != kNotShown) add_piece(conversion, line, from, before, weight, sums);
    from = after;
    piece = next;
  }
  if (piece != kNotShown) add_piece(conversion, line, from, to, weight, sums);
}

// Source texels from one end of the line to the other, along the way.
double span_of(const Conversion& conversion, const Line& line) {
  double span = 0;
  std::optional<MapPlace> last;
  for (int i = 0; i <= 8; ++i) {
    const double t = line.length * i / 8;
    const std::optional<MapPlace> q = conversion.place(line.at_x(t), line.at_y(t));
    if (q && last && q->chart == last->chart) {
      double dx = q->x - last->x;
      if (const int turn = turn_columns(conversion.from)) dx -= turn * std::nearbyint(dx / turn);
      span += std::hypot(dx, q->y - last->y);
    }
    last = q;
  }
  return span;
}

void add_line(const Conversion& conversion, const Line& line, double weight, Sums* sums) {
  // Twelve steps a source texel: a corner cut off between two steps is under 1/600 of a texel.
  const int steps = std::clamp(static_cast<int>(12 * span_of(conversion, line)), 16, 4096);
  double from = 0;
  int piece = conversion.piece(line.x, line.y);
  for (int i = 1; i <= steps; ++i) {
    const double to = line.length * i / steps;
    const int end = conversion.piece(line.at_x(to), line.at_y(to));
    add_step(conversion, line, from, to, piece, end, weight, sums);
    from = to;
    piece = end;
  }
}

// A direction that shows at a slope of 0.6 among the source's borders, with both parts above 0 once
// the texel is mirrored: solves J direction = (1, 0.6) or (1, -0.6).
struct Direction {
  double dx, dy;
};
Direction oblique(const Conversion& conversion, double x, double y) {
  double ax = 0, ay = 0, bx = 0, by = 0;
  conversion.derivative(x, y, 1, 0, &ax, &ay);
  conversion.derivative(x, y, 0, 1, &bx, &by);
  const double det = ax * by - ay * bx;
  Direction direction{1, 0.6};
  if (det != 0) direction = {(by - 0.6 * bx) / det, (0.6 * ax - ay) / det};
  const double length = std::hypot(direction.dx, direction.dy);
  return {direction.dx / length, direction.dy / length};
}

void add_rectangle(const Conversion& conversion, const Rectangle& r, int lines, Sums* sums) {
  const double w = r.x1 - r.x0, h = r.y1 - r.y0;
  const Direction along = oblique(conversion, r.x0 + 0.5 * w, r.y0 + 0.5 * h);
  // Lines that fall to the left are drawn on the mirrored rectangle.
  const bool mirrored = along.dx * along.dy < 0;
  const double dx = std::abs(along.dx), dy = std::abs(along.dy);
  // The offset of a line across its direction, 0 at the upper right corner.
  const double width = w * dy + h * dx;
  for (int i = 0; i < lines; ++i) {
    const double offset = width * (i + 0.5) / lines;
    // Through (x1 - offset dy, y0 + offset dx), cut at the four sides.
    const double px = w - offset * dy, py = offset * dx;
    constexpr double kNever = 1e9;
    const double enter = std::max(dx > 0 ? -px / dx : -kNever, dy > 0 ? -py / dy : -kNever);
    const double leave = std::min(dx > 0 ? (w - px) / dx : kNever, dy > 0 ? (h - py) / dy : kNever);
    if (!(leave > enter)) continue;
    const double x = px + enter * dx;
    add_line(conversion,
             {mirrored ? r.x1 - x : r.x0 + x, r.y0 + py + enter * dy, mirrored ? -dx : dx, dy,
              leave - enter},
             width / lines, sums);
  }
}

// The part of a texel that lies on its face and, with openexr, within the outer samples. Held a
// hair inside, where a border belongs to two faces.
Rectangle shown_part(const MapLayout& layout, int x, int y) {
  constexpr double kHair = 1e-9;
  const double margin = layout.convention == TexelConvention::openexr ? 0.5 : 0;
  const int size = is_cube(layout.kind) ? cube_face_size(layout) : 0;
  const int columns = size > 0 ? size : layout.width, rows = size > 0 ? size : layout.height;
  const int left = x / columns * columns, top = y / rows * rows;
  return {std::max<double>(x, left + margin) + kHair, std::max<double>(y, top + margin) + kHair,
          std::min<double>(x + 1, left + columns - margin) - kHair,
          std::min<double>(y + 1, top + rows - margin) - kHair};
}

}  // namespace

LayoutTruth layout_truth(const MapLayout& from, const Image& source, const MapLayout& to,
                         const Rotation& rotation, MapFilter filter, int x, int y, int lines) {
  const Conversion conversion{from,          source, to, rotation, filter == MapFilter::adaptive,
                              RowBlend(from)};
  std::vector<Rectangle> parts = {shown_part(to, x, y)};
  const std::optional<Vec3d> centre = layout_direction(to, x + 0.5, y + 0.5);
  if (to.convention == TexelConvention::openexr && centre) {
    // Other texels with the same centre; all of them lie on a border.
    const int rows = is_cube(to.kind) ? to.width : to.height;
    for (int j = 0; j < to.height; ++j) {
      const bool border_row = j % rows == 0 || j % rows == rows - 1;
      for (int i = 0; i < to.width; i = border_row || i > 0 ? i + 1 : to.width - 1) {
        if (i == x && j == y) continue;
        const Vec3d other = layout_direction(to, i + 0.5, j + 0.5).value();
        if (length(other - *centre) > 1e-9) continue;
        parts.push_back(shown_part(to, i, j));
      }
    }
  }
  Sums sums;
  const int each = std::max(6, lines / static_cast<int>(parts.size()));
  for (const Rectangle& part : parts) add_rectangle(conversion, part, each, &sums);
  return {sums.omega > 0 ? sums.energy / sums.omega : Vec3d{}, sums.brightest};
}

}  // namespace lightkiln
