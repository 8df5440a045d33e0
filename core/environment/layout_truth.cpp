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
#include "core/sphere/rim_patches.h"

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

// Lines are drawn in the image's own coordinates, or in those of a patch at a round rim, the second
// of which runs slowly at both ends: there a side may be tangent to a circle.
struct Conversion {
  const MapLayout& from;
  const Image& source;
  const MapLayout& to;
  const Rotation& rotation;
  bool adaptive;
  RowBlend blend;
  const RimPatch* patch = nullptr;

  std::optional<MapPlace> place_of(const std::optional<Vec3d>& d) const {
    return d ? layout_place(from, rotation.undo(*d)) : std::nullopt;
  }
  // Of a point of the image.
  std::optional<MapPlace> place(double x, double y) const {
    return place_of(layout_direction(to, x, y));
  }
  static double eased(double b) { return b * b * (3 - 2 * b); }
  // Of a point of a line.
  std::optional<Vec3d> direction(double a, double b) const {
    return patch != nullptr ? rim_point(to, *patch, a, eased(b)).direction
                            : layout_direction(to, a, b);
  }

  // Which piece of g a point of a line belongs to: a quarter of a texel of the source, on which N
  // is constant and B a polynomial.
  int piece(double a, double b) const {
    const std::optional<Vec3d> d = direction(a, b);
    if (!d) return kNotShown;
    const std::optional<MapPlace> q = place_of(d);
    if (!q) return kNotCovered;
    const int column = std::clamp(static_cast<int>(2 * q->x), 0, 2 * from.width - 1);
    return std::clamp(static_cast<int>(2 * q->y), 0, 2 * from.height - 1) * 2 * from.width + column;
  }

  // dq/dx or dq/dy, from both sides or from the one that lies on the same chart. `at` gives places.
  template <typename Places>
  static bool derivative(const MapLayout& from, const Places& at, double x, double y, double dx,
                         double dy, double* along, double* down) {
    constexpr double kStep = 1e-5;
    const std::optional<MapPlace> here = at(x, y);
    int sides = 0;
    *along = *down = 0;
    for (const double step : {kStep, -kStep}) {
      const std::optional<MapPlace> there = at(x + step * dx, y + step * dy);
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
    const auto at = [&](double px, double py) { return place(px, py); };
    if (!derivative(from, at, x, y, 1, 0, &ax, &ay)) return 1;
    if (!derivative(from, at, x, y, 0, 1, &bx, &by)) return 1;
    // The singular values' squares are the roots of z^2 - trace z + det^2.
    const double trace = ax * ax + ay * ay + bx * bx + by * by, det = ax * by - ay * bx;
    const double larger = 0.5 * (trace + std::sqrt(std::max(0.0, trace * trace - 4 * det * det)));
    const double smaller = larger > 0 ? std::abs(det) / std::sqrt(larger) : 0;
    return std::clamp(2 - 2 * smaller, 0.0, 1.0);
  }

  struct Sample {
    Vec3d radiance;
    double density = 0;
  };
  // At a point of a line; the density is that of its coordinates.
  Sample sample(double a, double b, double* brightest) const {
    Sample sample;
    RimPoint point{{}, a, b};
    std::optional<MapPlace> q;
    if (patch != nullptr) {
      point = rim_point(to, *patch, a, eased(b));
      q = place_of(point.direction);
      sample.density = rim_density(to, *patch, eased(b)) * 6 * b * (1 - b);
    } else {
      q = place(a, b);
      sample.density = solid_angle_density(to, a, b);
    }
    if (!q) return sample;
    const double share = smooth_share(point.x, point.y);
    const Vec3d held = nearest_radiance(from, source, *q);
    *brightest = std::max({*brightest, held.x, held.y, held.z});
    sample.radiance = held * (1 - share);
    if (share > 0) sample.radiance += smooth_radiance(from, source, *q, blend) * share;
    return sample;
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
    const Conversion::Sample sample =
        conversion.sample(line.at_x(t), line.at_y(t), &sums->brightest);
    const double omega = 0.5 * (to - from) * weight * sample.density;
    sums->energy += sample.radiance * omega;
    sums->omega += omega;
  }
}

// Where between `from`, on `piece`, and `to`, on another, the piece ends.
double end_of_piece(const Conversion& conversion, const Line& line, double from, double to,
                    int piece, double* begin_of_next, int* next) {
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (from + to);
    const int found = conversion.piece(line.at_x(middle), line.at_y(middle));
    if (found == piece) {
      from = middle;
    } else {
      to = middle;
      *next = found;
    }
  }
  *begin_of_next = to;
  return from;
}

// Source texels from one end of the line to the other, along the way.
double span_of(const Conversion& conversion, const Line& line) {
  double span = 0;
  std::optional<MapPlace> last;
  for (int i = 0; i <= 8; ++i) {
    const double t = line.length * i / 8;
    const std::optional<MapPlace> q =
        conversion.place_of(conversion.direction(line.at_x(t), line.at_y(t)));
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
  const int steps = std::clamp(static_cast<int>(12 * span_of(conversion, line)), 6, 4096);
  // The solid angle bends as well.
  const double longest = line.length / 4;
  double begin = 0, last = 0;
  int piece = conversion.piece(line.x, line.y);
  for (int i = 1; i <= steps; ++i) {
    const double to = line.length * i / steps;
    const int end = conversion.piece(line.at_x(to), line.at_y(to));
    while (piece != end) {
      double next_begin = to;
      int next = end;
      const double finish = end_of_piece(conversion, line, last, to, piece, &next_begin, &next);
      if (piece != kNotShown) add_piece(conversion, line, begin, finish, weight, sums);
      begin = last = next_begin;
      piece = next;
    }
    last = to;
    if (i == steps || last - begin >= longest) {
      if (piece != kNotShown) add_piece(conversion, line, begin, last, weight, sums);
      begin = last;
    }
  }
}

// A direction that shows at a slope of 0.6 among the source's borders, with both parts above 0 once
// the texel is mirrored: solves J direction = (1, 0.6) or (1, -0.6).
struct Direction {
  double dx, dy;
  double across;  // source texels that a unit step across it is away from the line
  double det;     // source texels to a unit of area
};
Direction oblique(const Conversion& conversion, double x, double y) {
  double ax = 0, ay = 0, bx = 0, by = 0;
  const auto at = [&](double a, double b) {
    return conversion.place_of(conversion.direction(a, b));
  };
  Conversion::derivative(conversion.from, at, x, y, 1, 0, &ax, &ay);
  Conversion::derivative(conversion.from, at, x, y, 0, 1, &bx, &by);
  const double det = ax * by - ay * bx;
  if (det == 0) return {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  const double dx = (by - 0.6 * bx) / det, dy = (0.6 * ax - ay) / det;
  const double length = std::hypot(dx, dy);
  return {dx / length, dy / length, std::abs(det) * length / std::hypot(1, 0.6), std::abs(det)};
}

// A line's integral bends where it passes a corner of the source's texels. With n lines to a source
// texel each bend costs about 1 / (12 n^2) of what neighbours differ by, A texels have A of them,
// of any sign, and 1 / (12 n^2 sqrt(A)) is left. `lines` are those of a texel that spans two of the
// source; `share` is the rectangle's of its texel.
int lines_needed(int lines, double share, double texels_across, double texels_inside) {
  const double most = lines * std::max(1.0, 0.5 * texels_across /
                                                std::sqrt(std::sqrt(std::max(1.0, texels_inside))));
  return std::clamp(static_cast<int>(most * std::min(1.0, 2 * std::sqrt(share))), 6, 4096);
}

void add_rectangle(const Conversion& conversion, const Rectangle& r, int least, double share,
                   Sums* sums) {
  const double w = r.x1 - r.x0, h = r.y1 - r.y0;
  const Direction along = oblique(conversion, r.x0 + 0.5 * w, r.y0 + 0.5 * h);
  // Lines that fall to the left are drawn on the mirrored rectangle.
  const bool mirrored = along.dx * along.dy < 0;
  const double dx = std::abs(along.dx), dy = std::abs(along.dy);
  // The offset of a line across its direction, 0 at the upper right corner.
  const double width = w * dy + h * dx;
  const int lines = lines_needed(least, share, width * along.across, along.det * w * h);
  // What a line gives bends where it passes a corner of the rectangle.
  const double corners[4] = {0, std::min(w * dy, h * dx), std::max(w * dy, h * dx), width};
  for (int section = 0; section < 3; ++section) {
    const double begin = corners[section], size = corners[section + 1] - begin;
    if (size <= 0) continue;
    const int pairs = static_cast<int>(std::ceil(0.5 * lines * size / width));
    for (int i = 0; i < 2 * pairs; ++i) {
      const double node = (i % 2 == 0 ? -0.5 : 0.5) / std::sqrt(3.0);
      const double offset = begin + size * (i / 2 + 0.5 + node) / pairs;
      // Through (x1 - offset dy, y0 + offset dx), cut at the four sides.
      const double px = w - offset * dy, py = offset * dx;
      constexpr double kNever = 1e9;
      const double enter = std::max(dx > 0 ? -px / dx : -kNever, dy > 0 ? -py / dy : -kNever);
      const double leave =
          std::min(dx > 0 ? (w - px) / dx : kNever, dy > 0 ? (h - py) / dy : kNever);
      if (!(leave > enter)) continue;
      const double x = px + enter * dx;
      const Line line{mirrored ? r.x1 - x : r.x0 + x, r.y0 + py + enter * dy, mirrored ? -dx : dx,
                      dy, leave - enter};
      add_line(conversion, line, size / (2 * pairs), sums);
    }
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
  Conversion conversion{from, source, to, rotation, filter == MapFilter::adaptive, RowBlend(from)};
  Sums sums;
  if (const std::vector<RimPatch> patches = rim_patches(to, x, y); !patches.empty()) {
    const double whole = texel_solid_angle(to, x, y);
    for (const RimPatch& patch : patches) {
      conversion.patch = &patch;
      const double share = rim_solid_angle(to, patch, 0, 1, 0, 1) / whole;
      add_rectangle(conversion, {0, 0, 1, 1}, lines, std::clamp(share, 0.0, 1.0), &sums);
    }
    return {sums.omega > 0 ? sums.energy / sums.omega : Vec3d{}, sums.brightest};
  }
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
  const int each = std::max(6, lines / static_cast<int>(parts.size()));
  for (const Rectangle& part : parts) add_rectangle(conversion, part, each, 1, &sums);
  return {sums.omega > 0 ? sums.energy / sums.omega : Vec3d{}, sums.brightest};
}

}  // namespace lightkiln
