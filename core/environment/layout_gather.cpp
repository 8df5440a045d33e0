// Every texel of the target is cut into cells whose four corners lie on one piece of the source's
// picture; a cell is then a small polygon there. Cells share corners, so that they tile the source:
// every source texel is dealt out completely, which is what keeps energy.
//
// How finely a texel is cut follows from the error that was ordered. Misplacing a share e of its
// weights changes its value by no more than e times the range of the source's values about it; in
// even light nothing has to be fine.

#include "core/environment/layout_gather.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/cube_cross.h"
#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

// Where more than this may be misplaced nothing is looked for.
constexpr double kNotAsked = 0.004;
// Halvings of a texel: at seams, where edges bend (and for the tightest orders), and where a fold
// crosses it.
constexpr int kDeepest = 9, kDeepestBend = 4, kDeepestTightBend = 7, kDeepestKink = 3;
constexpr double kTight = 1e-4;

GridPoint middle(const GridPoint& a, const GridPoint& b) {
  return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y)};
}

// The share of smoothing where a texel spans so many of the source.
double smooth_share(double smaller) {
  return std::clamp(2 - 2 * smaller, 0.0, 1.0);
}

}  // namespace

TexelGatherer::TexelGatherer(const ConversionTask& task)
    : task_(task), radial_(is_radial(task.source.layout.kind)) {}

CellCorner TexelGatherer::look_up(double x, double y) {
  ++work_.places;
  return locate(task_, x, y);
}

int TexelGatherer::column(int x) const {
  return task_.turn > 0 ? ((x % task_.turn) + task_.turn) % task_.turn
                        : std::clamp(x, 0, task_.source.layout.width - 1);
}

void TexelGatherer::add_texel(const TargetCell& cell, GatheredLight* light) {
  ++work_.texels;
  work_.places += 1;
  const std::optional<CellOutline> outline = outline_of(task_, cell.corners);
  allowed_ = allowed_misplacement(task_, cell, outline);
  if (task_.least == 0 && outline)
    add_outline(cell, *outline, 0, light);
  else
    add(cell, 0, light);
}

// Level 0 is the whole texel.
void TexelGatherer::add(const TargetCell& cell, int level, GatheredLight* light) {
  if (level >= task_.least) {
    if (const std::optional<CellOutline> outline = outline_of(task_, cell.corners)) {
      add_outline(cell, *outline, level, light);
      return;
    }
    // A seam misplaces a quarter of the cells that it crosses, half of them each way; it crosses
    // few texels.
    const int depth = static_cast<int>(std::ceil(std::log2(0.02 / allowed_) / 1.25));
    if (level >= std::clamp(depth, allowed_ < kNotAsked ? task_.seam_depth : 1, kDeepest)) {
      add_point(cell, light);
      return;
    }
  }
  split(cell, level, light);
}

void TexelGatherer::add_outline(const TargetCell& cell, const CellOutline& outline, int level,
                                GatheredLight* light) {
  const double size = 1.0 / (1 << level);
  double smooth = 0;
  if (task_.filter == MapFilter::adaptive) {
    smooth = smooth_share(outline.smaller / size);
    if (level < kDeepestKink && smooths_unevenly(outline, size)) {
      split(cell, level, light);
      return;
    }
  }
  // A cell is a small part of the texel, and a row of them half as much at each halving.
  const int deepest = allowed_ < kTight ? kDeepestTightBend : kDeepestBend;
  if (level < deepest && size * misplaced(cell, outline, smooth) > allowed_) {
    split(cell, level, light);
    return;
  }
  GatheredLight part;
  if (smooth < 1) add_area(cell, outline, 1 - smooth, &part);
  if (smooth > 0) add_smooth(cell, outline, smooth, level, &part);
  // Beside other parts of the texel it counts as much as it shows.
  const bool alone = level == 0 && task_.to.convention == TexelConvention::half_texel;
  light->add(part.mean(), alone ? part.omega : solid_angle(cell));
}

// A fold of either layout crosses the cell, so that one share of smoothing does not do for all of
// it.
bool TexelGatherer::smooths_unevenly(const CellOutline& outline, double size) const {
  constexpr double kEven = 0.2;
  if (allowed_ > kNotAsked) return false;
  double low = 1, high = 0;
  for (size_t i = 0; i < 4; ++i) {
    const double share = smooth_share(outline.smaller_at(i) / size);
    low = std::min(low, share);
    high = std::max(high, share);
  }
  return high - low > kEven;
}

// The share of weights that straight edges misplace. An edge that bends by d at its middle shifts a
// sliver of 2/3 of its length times d from one side to the other; opposite edges bend alike. What
// is interpolated changes by the shift itself.
double TexelGatherer::misplaced(const TargetCell& cell, const CellOutline& outline, double smooth) {
  constexpr double kShown = 0.125;  // shifts of opposite edges that cancel, and luck
  if (allowed_ > kNotAsked) return 0;
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  const CellCorner top = look_up(x, cell.y0), left = look_up(cell.x0, y), centre = look_up(x, y);
  if (!top.covered || !left.covered || !centre.covered) return 1;
  const auto& p = outline.points;
  const auto bend = [&](const CellCorner& corner, const GridPoint& straight) {
    GridPoint bent{corner.place.x - straight.x, corner.place.y - straight.y};
    if (task_.turn > 0) bent.x -= task_.turn * std::nearbyint(bent.x / task_.turn);
    return bent;
  };
  const GridPoint along = bend(top, middle(p[0], p[1])), down = bend(left, middle(p[0], p[3]));
  // Of the middle: what the other two edges bend by where these are straight.
  const GridPoint rest = bend(centre, middle(middle(p[0], p[1]), middle(p[2], p[3])));
  const double slivers = std::max(std::abs(along.x * outline.ay - along.y * outline.ax),
                                  std::abs(rest.x * outline.ay - rest.y * outline.ax)) +
                         std::max(std::abs(down.x * outline.by - down.y * outline.bx),
                                  std::abs(rest.x * outline.by - rest.y * outline.bx));
  const double shift = std::hypot(along.x, along.y) + std::hypot(down.x, down.y);
  const double by_area = std::min(1.0, 4.0 / 3.0 * slivers / std::max(outline.area, 1e-300));
  const double bent = (1 - smooth) * by_area + smooth * 2.0 / 3.0 * shift;
  return bent * std::min(1.0, kShown + 4 * bent);
}

void TexelGatherer::add_area(const TargetCell& cell, const CellOutline& outline, double share,
                             GatheredLight* light) {
  ++work_.polygons;
  coverage_.cover(outline.points.data(), 4);
  const double before = light->omega;
  for (int y = coverage_.top(); y <= coverage_.bottom(); ++y) {
    const int row = std::clamp(y, 0, task_.source.layout.height - 1);
    for (int x = coverage_.left(); x <= coverage_.right(); ++x) {
      const CoveredMoments& part = coverage_.moments(x, y);
      if (part.area <= 0) continue;
      int i = column(x), j = row;
      const TexelDensity::Linear& density = task_.source.density.linear(i, j);
      const double omega = double(density.centre) * part.area + double(density.along_x) * part.u +
                           double(density.along_y) * part.v;
      if (omega <= 0) continue;
      ++work_.covered;
      if (radial_) find_value(task_.source.layout, &i, &j);
      light->add(to_double(task_.source.image->rgb(i, j)), share * omega);
    }
  }
  // All of it where the source's texels have no solid angle.
  if (light->omega == before) add_point(cell, light);
}

void TexelGatherer::add_smooth(const TargetCell& cell, const CellOutline& outline, double share,
                               int level, GatheredLight* light) {
  if (!add_interpolated(outline, share, light)) add_points(cell, outline, share, level, light);
}

// Between four samples the interpolation is a polynomial, and its integral over the part of the
// polygon there follows from the part's moments: on the grid of samples, half a texel off that of
// texels. False where not all samples are inside the image and show something.
bool TexelGatherer::add_interpolated(const CellOutline& outline, double share,
                                     GatheredLight* light) {
  std::array<GridPoint, 4> points = outline.points;
  double low_x = points[0].x, high_x = low_x, low_y = points[0].y, high_y = low_y;
  for (GridPoint& p : points) {
    low_x = std::min(low_x, p.x);
    high_x = std::max(high_x, p.x);
    low_y = std::min(low_y, p.y);
    high_y = std::max(high_y, p.y);
    p.x -= 0.5;
    p.y -= 0.5;
  }
  int left = 0, top = 0, right = task_.source.layout.width, bottom = task_.source.layout.height;
  if (is_cube(task_.source.layout.kind)) {
    const int size = cube_face_size(task_.source.layout);
    const FacePlace face = face_place(task_.source.layout.kind, outline.chart - 1);
    left = face.column * size;
    top = face.row * size;
    right = left + size;
    bottom = top + size;
  }
  if (low_y < top + 0.5 || high_y >= bottom - 0.5) return false;
  if (task_.turn == 0 && (low_x < left + 0.5 || high_x >= right - 0.5)) return false;
  if (radial_) {
    const double half = 0.5 * task_.source.layout.width, safe = half - 3;
    const double x = std::max(std::abs(low_x - half), std::abs(high_x - half));
    const double y = std::max(std::abs(low_y - half), std::abs(high_y - half));
    if (safe <= 0 || x * x + y * y >= safe * safe) return false;
  }
  ++work_.polygons;
  coverage_.cover(points.data(), 4);
  for (int y = coverage_.top(); y <= coverage_.bottom(); ++y) {
    const double blend = task_.source.blend(y);
    for (int x = coverage_.left(); x <= coverage_.right(); ++x) {
      const CoveredMoments& part = coverage_.moments(x, y);
      if (part.area <= 0) continue;
      ++work_.covered;
      const int x0 = column(x), x1 = column(x + 1);
      // The lower row's weight t + k t (1 - t), t = v + 1/2, times 1 and times u; where k counts,
      // a part lies so close to its middle that u v^2 is u times v^2.
      const double bent = blend * (0.25 * part.area - part.vv);
      const double bent_u = blend * (0.25 * part.u - part.u * part.vv / part.area);
      const double lower = 0.5 * part.area + part.v + bent;
      const double lower_u = 0.5 * part.u + part.uv + bent_u;
      const double upper = part.area - lower, upper_u = part.u - lower_u;
      const double weights[4] = {0.5 * upper - upper_u, 0.5 * upper + upper_u,
                                 0.5 * lower - lower_u, 0.5 * lower + lower_u};
      // At the part's centroid.
      const double s = 0.5 + part.u / part.area, t = 0.5 + part.v / part.area;
      const double above = (1 - s) * task_.source.density(x0, y) + s * task_.source.density(x1, y);
      const double below =
          (1 - s) * task_.source.density(x0, y + 1) + s * task_.source.density(x1, y + 1);
      const double omega = share * ((1 - t) * above + t * below);
      light->add(to_double(task_.source.image->rgb(x0, y)), omega * std::max(0.0, weights[0]));
      light->add(to_double(task_.source.image->rgb(x1, y)), omega * std::max(0.0, weights[1]));
      light->add(to_double(task_.source.image->rgb(x0, y + 1)), omega * std::max(0.0, weights[2]));
      light->add(to_double(task_.source.image->rgb(x1, y + 1)), omega * std::max(0.0, weights[3]));
    }
  }
  return true;
}

// At places interpolated between the corners.
void TexelGatherer::add_points(const TargetCell& cell, const CellOutline& outline, double share,
                               int level, GatheredLight* light) {
  const auto& p = outline.points;
  const int most = std::max(2, 32 >> level);
  // n points a texel's side miss the integral of an interpolation by about 0.1 / n^2.
  const double per_texel = std::clamp(std::sqrt(0.05 / allowed_), 1.0, 10.0);
  const auto count = [&](double length) {
    return std::clamp(static_cast<int>(std::ceil(per_texel * length)), 1, most);
  };
  const int columns = count(std::sqrt(outline.ax * outline.ax + outline.ay * outline.ay));
  const int rows = count(std::sqrt(outline.bx * outline.bx + outline.by * outline.by));
  const double area = share * (cell.x1 - cell.x0) * (cell.y1 - cell.y0) / (columns * rows);
  const double d0 = solid_angle_density(task_.to, cell.x0, cell.y0);
  const double d1 = solid_angle_density(task_.to, cell.x1, cell.y0);
  const double d2 = solid_angle_density(task_.to, cell.x1, cell.y1);
  const double d3 = solid_angle_density(task_.to, cell.x0, cell.y1);
  for (int j = 0; j < rows; ++j) {
    const double t = (j + 0.5) / rows;
    const GridPoint left{p[0].x + t * (p[3].x - p[0].x), p[0].y + t * (p[3].y - p[0].y)};
    const GridPoint right{p[1].x + t * (p[2].x - p[1].x), p[1].y + t * (p[2].y - p[1].y)};
    const double left_density = d0 + t * (d3 - d0), right_density = d1 + t * (d2 - d1);
    for (int i = 0; i < columns; ++i) {
      const double s = (i + 0.5) / columns;
      MapPlace place{left.x + s * (right.x - left.x), left.y + s * (right.y - left.y),
                     outline.chart};
      if (task_.turn > 0) {
        const double start = task_.source.layout.convention == TexelConvention::openexr ? 0.5 : 0;
        place.x -= task_.turn * std::floor((place.x - start) / task_.turn);
      }
      ++work_.points;
      light->add(
          smooth_radiance(task_.source.layout, *task_.source.image, place, task_.source.blend),
          area * (left_density + s * (right_density - left_density)));
    }
  }
}

void TexelGatherer::add_point(const TargetCell& cell, GatheredLight* light) {
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  const CellCorner centre = look_up(x, y);
  if (!centre.shown) return;
  Vec3d radiance;
  if (centre.covered) {
    ++work_.points;
    radiance = task_.filter == MapFilter::area
                   ? nearest_radiance(task_.source.layout, *task_.source.image, centre.place)
                   : smooth_radiance(task_.source.layout, *task_.source.image, centre.place,
                                     task_.source.blend);
  }
  light->add(radiance,
             (cell.x1 - cell.x0) * (cell.y1 - cell.y0) * solid_angle_density(task_.to, x, y));
}

double TexelGatherer::solid_angle(const TargetCell& cell) const {
  return (cell.x1 - cell.x0) * (cell.y1 - cell.y0) *
         solid_angle_density(task_.to, 0.5 * (cell.x0 + cell.x1), 0.5 * (cell.y0 + cell.y1));
}

void TexelGatherer::split(const TargetCell& cell, int level, GatheredLight* light) {
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  const CellCorner top = look_up(x, cell.y0), left = look_up(cell.x0, y);
  const CellCorner right = look_up(cell.x1, y), bottom = look_up(x, cell.y1);
  const CellCorner centre = look_up(x, y);
  bool any = centre.shown || top.shown || left.shown || right.shown || bottom.shown;
  for (const CellCorner& corner : cell.corners) any = any || corner.shown;
  if (!any) return;
  const auto& [c0, c1, c2, c3] = cell.corners;
  add({cell.x0, cell.y0, x, y, {c0, top, centre, left}}, level + 1, light);
  add({x, cell.y0, cell.x1, y, {top, c1, right, centre}}, level + 1, light);
  add({x, y, cell.x1, cell.y1, {centre, right, c2, bottom}}, level + 1, light);
  add({cell.x0, y, x, cell.y1, {left, centre, bottom, c3}}, level + 1, light);
}

}  // namespace lightkiln
