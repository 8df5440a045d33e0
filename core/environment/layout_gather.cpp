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

#include "core/environment/layout_bend.h"
#include "core/sphere/cube_cross.h"
#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

// Halvings of a texel: at seams, where edges bend (and for the tightest orders), and where a fold
// crosses it.
constexpr int kDeepest = 9, kDeepestBend = 4, kDeepestTightBend = 7;
constexpr int kDeepestKink = 4, kDeepestTightKink = 7;
constexpr double kTight = 1e-4;
// Two parts with outlines of their own are sooner done.
constexpr double kManyPoints = 48;

GridPoint middle(const GridPoint& a, const GridPoint& b) {
  return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y)};
}

}  // namespace

TexelGatherer::TexelGatherer(const ConversionTask& task)
    : task_(task), radial_(is_radial(task.source.layout.kind)) {}

CellCorner TexelGatherer::look_up(double x, double y) {
  ++work_.places;
  return patch_ != nullptr ? locate(task_, *patch_, x, y) : locate(task_, x, y);
}

int TexelGatherer::column(int x) const {
  return task_.turn > 0 ? ((x % task_.turn) + task_.turn) % task_.turn
                        : std::clamp(x, 0, task_.source.layout.width - 1);
}

void TexelGatherer::add_texel(const TargetCell& cell, GatheredLight* light) {
  ++work_.texels;
  work_.places += 1;
  const std::vector<RimPatch> patches =
      rim_patches(task_.to, static_cast<int>(0.5 * (cell.x0 + cell.x1)),
                  static_cast<int>(0.5 * (cell.y0 + cell.y1)));
  if (!patches.empty()) {
    add_rim(patches, light);
    return;
  }
  const std::optional<CellOutline> outline = outline_of(task_, cell.corners);
  ValueRange range;
  add_values(task_, cell, outline, &range);
  allowed_ = allowed_misplacement(task_, range);
  if (task_.least == 0 && outline && !outline->wide)
    add_outline(cell, *outline, 0, light);
  else
    add(cell, 0, light);
}

// A texel at a rim, piece by piece.
void TexelGatherer::add_rim(const std::vector<RimPatch>& patches, GatheredLight* light) {
  constexpr int kCells = 2;  // a side, to look for what a long piece shows
  std::vector<TargetCell> wholes;
  std::vector<double> omegas;
  double omega = 0;
  ValueRange range;
  for (const RimPatch& patch : patches) {
    patch_ = &patch;
    std::array<CellCorner, (kCells + 1) * (kCells + 1)> corners;
    const auto corner = [&](int i, int j) -> CellCorner& {
      return corners[static_cast<size_t>(j * (kCells + 1) + i)];
    };
    for (int j = 0; j <= kCells; ++j) {
      for (int i = 0; i <= kCells; ++i) {
        corner(i, j) = look_up(double(i) / kCells, double(j) / kCells);
      }
    }
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) {
        const TargetCell part{
            0, 0, 0, 0, {corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)}};
        add_values(task_, part, outline_of(task_, part.corners), &range);
      }
    }
    omegas.push_back(rim_solid_angle(task_.to, patch, 0, 1, 0, 1));
    omega += omegas.back();
    wholes.push_back(
        {0, 0, 1, 1, {corner(0, 0), corner(kCells, 0), corner(kCells, kCells), corner(0, kCells)}});
  }
  allowed_ = allowed_misplacement(task_, range);
  for (size_t i = 0; i < patches.size(); ++i) {
    patch_ = &patches[i];
    part_ = omegas[i] / omega;
    add(wholes[i], 0, light);
  }
  patch_ = nullptr;
  part_ = 1;
}

// Level 0 is the whole texel.
void TexelGatherer::add(const TargetCell& cell, int level, GatheredLight* light) {
  if (level >= task_.least) {
    if (const std::optional<CellOutline> outline = outline_of(task_, cell.corners)) {
      if (outline->wide && level < kDeepest) {
        divide(cell, *outline, level, light);
      } else {
        add_outline(cell, *outline, level, light);
      }
      return;
    }
    // A seam misplaces a quarter of the cells that it crosses, half of them each way; it crosses
    // few texels.
    const int depth = static_cast<int>(std::ceil(std::log2(0.02 / allowed_) / 1.25));
    // About a pole cells are all seams.
    constexpr int kLeastAtPole = 4;
    int least = allowed_ < task_.not_asked ? task_.seam_depth : std::max(1, task_.seam_depth - 2);
    for (const CellCorner& corner : cell.corners) {
      if (corner.covered && by_pole(task_, corner.place.y)) least = std::max(least, kLeastAtPole);
    }
    if (level >= std::clamp(depth, least, kDeepest)) {
      add_point(cell, light);
      return;
    }
  }
  split(cell, level, light);
}

void TexelGatherer::add_outline(const TargetCell& cell, const CellOutline& outline, int level,
                                GatheredLight* light) {
  const double size = part_ / (1 << level);
  // Where nothing is looked for only odd cells are: in slender ones edges that bend by a hair move
  // much of the light from one end to the other, and skewed ones lie about a pole or a fold.
  const bool asked =
      allowed_ <= task_.not_asked || (allowed_ < 1 && (outline.slender() || outline.skewed()));
  const bool adaptive = task_.filter == MapFilter::adaptive;
  SmoothShare share;
  if (adaptive) share.middle = smooth_share(outline.span);
  if (!asked) {
    lay_over(cell, outline, share, level, {}, light);
    return;
  }
  CellBends bends;
  const bool seen = look_along_edges(cell, outline, &bends);
  if (seen && adaptive) {
    share = smooth_share_over(outline, bends);
    // A fold of either layout crosses the cell.
    constexpr double kEven = 0.2;
    const bool first = share.first_step > kEven, second = share.second_step > kEven;
    const int deepest = allowed_ < kTight ? kDeepestTightKink : kDeepestKink;
    if (level < deepest && first != second) {
      halve(cell, first, level, light);
      return;
    }
    if (level < deepest && first) {
      split(cell, level, light);
      return;
    }
    if (first || second || outline.skewed()) share.along_x = share.along_y = 0;
    share.middle = smooth_share(outline.span);
  }
  const double smooth = share.middle;
  const double points = std::max(1.0, fineness() * outline.first_length()) *
                        std::max(1.0, fineness() * outline.second_length());
  Shape shape;
  for (const double left : {1.0, 0.25}) {
    const Misplaced moved = misplaced_by(outline, bends, left);
    shape = {left < 1 ? &bends : nullptr, size * smooth * moved.within > allowed_};
    const double misplaced =
        (1 - smooth) * (moved.among_texels + moved.within) +
        smooth * (moved.between_samples + (shape.by_points ? 0 : moved.within));
    if (seen && size * misplaced <= allowed_ && !(shape.by_points && points > kManyPoints)) {
      lay_over(cell, outline, share, level, shape, light);
      return;
    }
  }
  // A cell is a small part of the texel, and a row of them half as much at each halving.
  const int deepest = allowed_ < kTight ? kDeepestTightBend : kDeepestBend;
  if (level < deepest) {
    divide(cell, outline, level, light);
  } else {
    shape.bends = nullptr;
    lay_over(cell, outline, share, level, shape, light);
  }
}

void TexelGatherer::lay_over(const TargetCell& cell, const CellOutline& outline,
                             const SmoothShare& smooth, int level, const Shape& shape,
                             GatheredLight* light) {
  GatheredLight part;
  if (!smooth.full()) add_area(outline, shape.bends, smooth, &part);
  // Points have weights of their own, whatever the outline's shape.
  if (!smooth.none() &&
      (shape.by_points || !add_interpolated(outline, shape.bends, smooth, &part))) {
    add_points(cell, outline, shape.bends, smooth, level, &part);
  }
  // All of it where the source's texels have no solid angle.
  if (part.omega == 0) add_point(cell, &part);
  // Beside other parts of the texel it counts as much as it shows.
  const bool alone =
      level == 0 && patch_ == nullptr && task_.to.convention == TexelConvention::half_texel;
  light->add(part.mean(), alone ? part.omega : solid_angle(cell));
}

// False where an edge leaves the picture.
bool TexelGatherer::look_along_edges(const TargetCell& cell, const CellOutline& outline,
                                     CellBends* bends) {
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  const CellCorner middles[4] = {look_up(x, cell.y0), look_up(cell.x1, y), look_up(x, cell.y1),
                                 look_up(cell.x0, y)};
  GridPoint* const found[4] = {&bends->top, &bends->right, &bends->bottom, &bends->left};
  for (size_t i = 0; i < 4; ++i) {
    if (!middles[i].covered) return false;
    const GridPoint straight = middle(outline.points[i], outline.points[(i + 1) % 4]);
    const GridPoint here = middle(outline.target[i], outline.target[(i + 1) % 4]);
    bends->target[i] = {middles[i].at.x - here.x, middles[i].at.y - here.y};
    *found[i] = {middles[i].place.x - straight.x, middles[i].place.y - straight.y};
    if (task_.turn > 0) found[i]->x -= task_.turn * std::nearbyint(found[i]->x / task_.turn);
  }
  // A fold that no edge tells of shows in the middle.
  const CellCorner centre = look_up(x, y);
  if (!centre.covered) return false;
  const GridPoint expected = bent_place(outline, *bends, 0.5, 0.5);
  double off = centre.place.x - expected.x;
  if (task_.turn > 0) off -= task_.turn * std::nearbyint(off / task_.turn);
  const double down = centre.place.y - expected.y;
  return off * off + down * down < 0.0025 * std::max(1.0, outline.area);
}

// On the grid of texels, or of samples, which is half a texel off it.
void TexelGatherer::cover(const CellOutline& outline, const CellBends* bends, double shift) {
  work_.polygons += bends != nullptr ? 2 : 1;  // by their edges
  std::array<GridPoint, 8> border;
  size_t count = 4;
  if (bends != nullptr) {
    border = bent_border(outline, *bends);
    count = 8;
  } else {
    std::copy(outline.points.begin(), outline.points.end(), border.begin());
  }
  for (size_t i = 0; i < count; ++i) {
    border[i].x -= shift;
    border[i].y -= shift;
  }
  coverage_.cover(border.data(), count);
}

void TexelGatherer::add_area(const CellOutline& outline, const CellBends* bends,
                             const SmoothShare& smooth, GatheredLight* light) {
  cover(outline, bends, 0);
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
      const double smoothed =
          smooth.at(x + 0.5, y + 0.5) * omega +
          double(density.centre) * (smooth.along_x * part.u + smooth.along_y * part.v);
      ++work_.covered;
      if (radial_) find_value(task_.source.layout, &i, &j);
      light->add(to_double(task_.source.image->rgb(i, j)), std::max(0.0, omega - smoothed));
    }
  }
}

// Between four samples the interpolation is a polynomial, and its integral over the part of the
// polygon there follows from the part's moments: on the grid of samples, half a texel off that of
// texels. False where not all samples are inside the image and show something, or the polygon has
// no area.
bool TexelGatherer::add_interpolated(const CellOutline& outline, const CellBends* bends,
                                     const SmoothShare& smooth, GatheredLight* light) {
  double low_x = outline.points[0].x, high_x = low_x, low_y = outline.points[0].y, high_y = low_y;
  const auto include = [&](const GridPoint& p) {
    low_x = std::min(low_x, p.x);
    high_x = std::max(high_x, p.x);
    low_y = std::min(low_y, p.y);
    high_y = std::max(high_y, p.y);
  };
  if (bends != nullptr) {
    for (const GridPoint& p : bent_border(outline, *bends)) include(p);
  } else {
    for (const GridPoint& p : outline.points) include(p);
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
  cover(outline, bends, 0.5);
  const double before = light->omega;
  for (int y = coverage_.top(); y <= coverage_.bottom(); ++y) {
    const double blend = task_.source.blend(y);
    for (int x = coverage_.left(); x <= coverage_.right(); ++x) {
      const CoveredMoments& part = coverage_.moments(x, y);
      if (part.area <= 0) continue;
      ++work_.covered;
      const int x0 = column(x), x1 = column(x + 1);
      // The share of smoothing times the solid angle's density, h + g u + f v, times 1, u, v and u
      // v; u^2 v and u v^2 as if u and v were independent over the part.
      const double d0 = task_.source.density(x0, y), d1 = task_.source.density(x1, y);
      const double d2 = task_.source.density(x0, y + 1), d3 = task_.source.density(x1, y + 1);
      const double density = 0.25 * (d0 + d1 + d2 + d3), share = smooth.at(x + 1, y + 1);
      const double h = share * density;
      const double g = smooth.along_x * density + share * 0.5 * (d1 - d0 + d3 - d2);
      const double f = smooth.along_y * density + share * 0.5 * (d2 - d0 + d3 - d1);
      const double one = h * part.area + g * part.u + f * part.v;
      const double by_u = h * part.u + g * part.uu + f * part.uv;
      const double by_v = h * part.v + g * part.uv + f * part.vv;
      const double by_uv = h * part.uv + (g * part.uu * part.v + f * part.u * part.vv) / part.area;
      // The lower row's weight t + k t (1 - t), t = v + 1/2, times these; where k counts, a part
      // lies so close to its middle that u v^2 is u times v^2.
      const double bent = h * blend * (0.25 * part.area - part.vv);
      const double bent_u = h * blend * (0.25 * part.u - part.u * part.vv / part.area);
      const double lower = 0.5 * one + by_v + bent, lower_u = 0.5 * by_u + by_uv + bent_u;
      const double upper = one - lower, upper_u = by_u - lower_u;
      const double weights[4] = {0.5 * upper - upper_u, 0.5 * upper + upper_u,
                                 0.5 * lower - lower_u, 0.5 * lower + lower_u};
      light->add(to_double(task_.source.image->rgb(x0, y)), std::max(0.0, weights[0]));
      light->add(to_double(task_.source.image->rgb(x1, y)), std::max(0.0, weights[1]));
      light->add(to_double(task_.source.image->rgb(x0, y + 1)), std::max(0.0, weights[2]));
      light->add(to_double(task_.source.image->rgb(x1, y + 1)), std::max(0.0, weights[3]));
    }
  }
  return light->omega > before;
}

// n points a texel's side miss the integral of an interpolation by about 0.1 / n^2.
double TexelGatherer::fineness() const {
  return std::clamp(std::sqrt(0.05 / allowed_), 1.0, 24.0);
}

// At places interpolated between the corners.
void TexelGatherer::add_points(const TargetCell& cell, const CellOutline& outline,
                               const CellBends* bends, const SmoothShare& smooth, int level,
                               GatheredLight* light) {
  const auto& p = outline.points;
  const int most = std::max(2, 32 >> level);
  const auto count = [&](double length) {
    return std::clamp(static_cast<int>(std::ceil(fineness() * length)), 1, most);
  };
  const int columns = count(outline.first_length()), rows = count(outline.second_length());
  const double width = cell.x1 - cell.x0, height = cell.y1 - cell.y0;
  const double area = width * height / (columns * rows);
  double d[4] = {0, 0, 0, 0};
  if (patch_ == nullptr) {
    d[0] = solid_angle_density(task_.to, cell.x0, cell.y0);
    d[1] = solid_angle_density(task_.to, cell.x1, cell.y0);
    d[2] = solid_angle_density(task_.to, cell.x1, cell.y1);
    d[3] = solid_angle_density(task_.to, cell.x0, cell.y1);
  }
  for (int j = 0; j < rows; ++j) {
    const double t = (j + 0.5) / rows;
    const GridPoint left{p[0].x + t * (p[3].x - p[0].x), p[0].y + t * (p[3].y - p[0].y)};
    const GridPoint right{p[1].x + t * (p[2].x - p[1].x), p[1].y + t * (p[2].y - p[1].y)};
    const double rim = patch_ != nullptr ? rim_density(task_.to, *patch_, cell.y0 + t * height) : 0;
    const double left_density = rim + d[0] + t * (d[3] - d[0]);
    const double right_density = rim + d[1] + t * (d[2] - d[1]);
    for (int i = 0; i < columns; ++i) {
      const double s = (i + 0.5) / columns;
      MapPlace place{left.x + s * (right.x - left.x), left.y + s * (right.y - left.y),
                     outline.chart};
      if (bends != nullptr) {
        const GridPoint bent = bent_place(outline, *bends, s, t);
        place.x = bent.x;
        place.y = bent.y;
      }
      const double share = std::clamp(smooth.at(place.x, place.y), 0.0, 1.0);
      if (task_.turn > 0) {
        const double start = task_.source.layout.convention == TexelConvention::openexr ? 0.5 : 0;
        place.x -= task_.turn * std::floor((place.x - start) / task_.turn);
      }
      ++work_.points;
      light->add(
          smooth_radiance(task_.source.layout, *task_.source.image, place, task_.source.blend),
          share * area * (left_density + s * (right_density - left_density)));
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
    const MapLayout& from = task_.source.layout;
    const Image& image = *task_.source.image;
    const double smooth = smooth_share_at(cell, centre);
    if (smooth < 1) radiance += nearest_radiance(from, image, centre.place) * (1 - smooth);
    if (smooth > 0) {
      radiance += smooth_radiance(from, image, centre.place, task_.source.blend) * smooth;
    }
  }
  light->add(radiance, solid_angle(cell));
}

// By the next places to either side that lie on the same piece of the source's picture.
double TexelGatherer::smooth_share_at(const TargetCell& cell, const CellCorner& centre) {
  if (task_.filter == MapFilter::area) return 0;
  constexpr double kStep = 1e-3;
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  GridPoint sides[2], source_sides[2];
  for (int k = 0; k < 2; ++k) {
    bool found = false;
    for (const double step : {kStep, -kStep}) {
      const CellCorner next = k == 0 ? look_up(x + step * (cell.x1 - cell.x0), y)
                                     : look_up(x, y + step * (cell.y1 - cell.y0));
      if (!next.covered || next.place.chart != centre.place.chart) continue;
      sides[k] = {next.at.x - centre.at.x, next.at.y - centre.at.y};
      source_sides[k] = {next.place.x - centre.place.x, next.place.y - centre.place.y};
      if (const int turn = task_.turn; turn > 0) {
        source_sides[k].x -= turn * std::nearbyint(source_sides[k].x / turn);
      }
      found = true;
      break;
    }
    if (!found) return 1;
  }
  return smooth_share(smaller_span(sides[0], sides[1], source_sides[0], source_sides[1]));
}

double TexelGatherer::solid_angle(const TargetCell& cell) const {
  if (patch_ != nullptr) {
    return rim_solid_angle(task_.to, *patch_, cell.x0, cell.x1, cell.y0, cell.y1);
  }
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

void TexelGatherer::halve(const TargetCell& cell, bool by_columns, int level,
                          GatheredLight* light) {
  const auto& [c0, c1, c2, c3] = cell.corners;
  if (by_columns) {
    const double x = 0.5 * (cell.x0 + cell.x1);
    const CellCorner top = look_up(x, cell.y0), bottom = look_up(x, cell.y1);
    add({cell.x0, cell.y0, x, cell.y1, {c0, top, bottom, c3}}, level + 1, light);
    add({x, cell.y0, cell.x1, cell.y1, {top, c1, c2, bottom}}, level + 1, light);
  } else {
    const double y = 0.5 * (cell.y0 + cell.y1);
    const CellCorner left = look_up(cell.x0, y), right = look_up(cell.x1, y);
    add({cell.x0, cell.y0, cell.x1, y, {c0, c1, right, left}}, level + 1, light);
    add({cell.x0, y, cell.x1, cell.y1, {left, right, c2, c3}}, level + 1, light);
  }
}

// Long cells across, others into four.
void TexelGatherer::divide(const TargetCell& cell, const CellOutline& outline, int level,
                           GatheredLight* light) {
  constexpr double kLong = 3;
  const double first = outline.first_length(), second = outline.second_length();
  if (first > kLong * second || second > kLong * first) {
    halve(cell, first > second, level, light);
  } else {
    split(cell, level, light);
  }
}

}  // namespace lightkiln
