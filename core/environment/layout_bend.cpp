// An edge that bends by d at its middle shifts a sliver of 2/3 of its length times d from one side
// to the other; through the middle, two halves that bend by d/4 leave a quarter of that. Opposite
// edges bend alike, so that a cell is shifted and keeps its shape: across a slender cell that moves
// no more than 2/3 d of what lies on either side of a border. Where opposite edges bend unlike, by
// e, the cell is wider or narrower than it seems, and 2/3 e over its width is the share of the
// light that is moved along; edges that do not lie beside each other but one behind the other do so
// by bending alike.

#include "core/environment/layout_bend.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

namespace {

GridPoint plus(const GridPoint& a, const GridPoint& b, double scale) {
  return {a.x + scale * b.x, a.y + scale * b.y};
}
GridPoint middle(const GridPoint& a, const GridPoint& b, const GridPoint& bend) {
  return {0.5 * (a.x + b.x) + bend.x, 0.5 * (a.y + b.y) + bend.y};
}

}  // namespace

std::array<GridPoint, 8> bent_border(const CellOutline& outline, const CellBends& bends) {
  const auto& p = outline.points;
  return {p[0], middle(p[0], p[1], bends.top),    p[1], middle(p[1], p[2], bends.right),
          p[2], middle(p[2], p[3], bends.bottom), p[3], middle(p[3], p[0], bends.left)};
}

GridPoint bent_place(const CellOutline& outline, const CellBends& bends, double s, double t) {
  const auto& p = outline.points;
  const GridPoint above = plus(p[0], {p[1].x - p[0].x, p[1].y - p[0].y}, s);
  const GridPoint below = plus(p[3], {p[2].x - p[3].x, p[2].y - p[3].y}, s);
  GridPoint place = plus(above, {below.x - above.x, below.y - above.y}, t);
  const double along = 4 * s * (1 - s), down = 4 * t * (1 - t);
  place = plus(plus(place, bends.top, along * (1 - t)), bends.bottom, along * t);
  return plus(plus(place, bends.left, down * (1 - s)), bends.right, down * s);
}

Misplaced misplaced_by(const CellOutline& outline, const CellBends& bends, double left) {
  const auto across = [&](const GridPoint& bent, double side_x, double side_y) {
    return std::abs(bent.x * side_y - bent.y * side_x) / std::max(outline.area, 1e-300);
  };
  const auto most = [&](const GridPoint& bent) {
    return std::max(across(bent, outline.ax, outline.ay), across(bent, outline.bx, outline.by));
  };
  const double along = std::max(across(bends.top, outline.ax, outline.ay),
                                across(bends.bottom, outline.ax, outline.ay));
  const double down = std::max(across(bends.left, outline.bx, outline.by),
                               across(bends.right, outline.bx, outline.by));
  const auto size = [](const GridPoint& a, const GridPoint& b) {
    return std::sqrt(std::max(a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y));
  };
  const double shift = left * (size(bends.top, bends.bottom) + size(bends.left, bends.right));
  const double slivers = left * 4.0 / 3.0 * (along + down);
  // Shifts of opposite edges partly cancel, and luck does its part.
  const auto seen = [](double bent) {
    constexpr double kShown = 0.5;
    return bent * std::min(1.0, kShown + 4 * bent);
  };
  Misplaced found;
  found.between_samples = seen(2.0 / 3.0 * shift);
  found.among_texels = seen(std::min(1.0, slivers));
  if (!outline.slender()) return found;
  found.among_texels = seen(std::min({1.0, slivers, 4.0 / 3.0 * shift}));
  const GridPoint wider = plus(bends.bottom, bends.top, -1);
  const GridPoint higher = plus(bends.right, bends.left, -1);
  const double behind = std::abs(outline.ax * outline.bx + outline.ay * outline.by);
  const double first = outline.ax * outline.ax + outline.ay * outline.ay;
  const double second = outline.bx * outline.bx + outline.by * outline.by;
  const double unlike = most(wider) + most(higher) +
                        std::min(1.0, behind / std::max(first, 1e-300)) * along +
                        std::min(1.0, behind / std::max(second, 1e-300)) * down;
  // What is moved differs by no more than values do over the cell's length.
  const double length = std::max(outline.first_length(), outline.second_length());
  found.within = left * 0.5 * std::min(1.0, 2.0 / 3.0 * unlike) * std::min(1.0, length);
  return found;
}

double smooth_share(double span) {
  return std::clamp(2 - 2 * span, 0.0, 1.0);
}

double SmoothShare::at(double x, double y) const {
  return middle + along_x * (x - centre.x) + along_y * (y - centre.y);
}

namespace {

// By the tangents at corner i: an edge that bends by d leaves its end along the chord and 4 d.
double span_at(const CellOutline& outline, const CellBends& bends, size_t i) {
  const std::array<GridPoint, 4> source = {bends.top, bends.right, bends.bottom, bends.left};
  const auto tangent = [&](const std::array<GridPoint, 4>& p, const std::array<GridPoint, 4>& bend,
                           size_t edge, size_t to) {
    return GridPoint{p[to].x - p[i].x + 4 * bend[edge].x, p[to].y - p[i].y + 4 * bend[edge].y};
  };
  const size_t next = (i + 1) % 4, last = (i + 3) % 4;
  return smaller_span(tangent(outline.target, bends.target, i, next),
                      tangent(outline.target, bends.target, last, last),
                      tangent(outline.points, source, i, next),
                      tangent(outline.points, source, last, last));
}

}  // namespace

// With the share's differences a and b along the sides A and B, its gradient g solves g . A = a and
// g . B = b. A slender cell knows its gradient along its length alone.
SmoothShare smooth_share_over(const CellOutline& outline, const CellBends& bends) {
  const auto& p = outline.points;
  SmoothShare share;
  share.middle = smooth_share(outline.span);
  share.centre = {0.25 * (p[0].x + p[1].x + p[2].x + p[3].x),
                  0.25 * (p[0].y + p[1].y + p[2].y + p[3].y)};
  double at[4];
  for (size_t i = 0; i < 4; ++i) at[i] = smooth_share(span_at(outline, bends, i));
  share.first_step = std::max(std::abs(at[0] - at[1]), std::abs(at[3] - at[2]));
  share.second_step = std::max(std::abs(at[0] - at[3]), std::abs(at[1] - at[2]));
  if (share.first_step == 0 && share.second_step == 0) return share;
  const double a = 0.5 * (at[1] - at[0] + at[2] - at[3]);
  const double b = 0.5 * (at[3] - at[0] + at[2] - at[1]);
  const double ax = outline.ax, ay = outline.ay, bx = outline.bx, by = outline.by;
  if (!outline.slender()) {
    const double det = ax * by - ay * bx;
    share.along_x = (a * by - b * ay) / det;
    share.along_y = (b * ax - a * bx) / det;
    return share;
  }
  const double first = ax * ax + ay * ay, second = bx * bx + by * by;
  const double scale = first > second ? a / first : second > 0 ? b / second : 0;
  share.along_x = scale * (first > second ? ax : bx);
  share.along_y = scale * (first > second ? ay : by);
  return share;
}

}  // namespace lightkiln
