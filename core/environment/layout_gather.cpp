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
// Two parts with outlines of their own are sooner done.
constexpr double kManyPoints = 48;

GridPoint middle(const GridPoint& a, const GridPoint& b) {
  return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y)};
}

// The share of smoothing where a texel spans so many of the source.
double smooth_share(double span) {
  return std::clamp(2 - 2 * span, 0.0, 1.0);
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
    if (level >= std::clamp(depth, allowed_ < kNotAsked ? task_.seam_depth : 1, kDeepest)) {
      add_point(cell, light);
      return;
    }
  }
  split(cell, level, light);
}

void TexelGatherer::add_outline(const TargetCell& cell, const CellOutline& outline, int level,
                                GatheredLight* light) {
  const double size = part_ / (1 << level);
  double smooth = 0;
  if (task_.filter == MapFilter::adaptive) {
    smooth = smooth_share(outline.span);
    const Uneven uneven = level < kDeepestKink ? smooths_unevenly(outline) : Uneven{};
    if (uneven.first != uneven.second) {
      halve(cell, uneven.first, level, light);
      return;
    }
    if (uneven.first) {
      split(cell, level, light);
      return;
    }
  }
  // Where nothing is looked for only slender cells are: in them edges that bend by a hair move much
  // of the light from one end to the other.
  const bool asked = allowed_ <= kNotAsked || (allowed_ < 1 && outline.slender());
  const Bend bend = asked ? bend_of(cell, outline) : Bend{};
  const bool deformed = size * smooth * bend.within > allowed_;
  const double misplaced = (1 - smooth) * (bend.among_texels + bend.within) +
                           smooth * (bend.between_samples + (deformed ? 0 : bend.within));
  // A cell is a small part of the texel, and a row of them half as much at each halving.
  const int deepest = allowed_ < kTight ? kDeepestTightBend : kDeepestBend;
  const double points = std::max(1.0, fineness() * outline.first_length()) *
                        std::max(1.0, fineness() * outline.second_length());
  if (level < deepest && (size * misplaced > allowed_ || (deformed && points > kManyPoints))) {
    divide(cell, outline, level, light);
    return;
  }
  GatheredLight part;
  if (smooth < 1) add_area(cell, outline, 1 - smooth, &part);
  // Points have weights of their own, whatever the outline's shape.
  if (smooth > 0 && (deformed || !add_interpolated(outline, smooth, &part))) {
    add_points(cell, outline, smooth, level, &part);
  }
  // Beside other parts of the texel it counts as much as it shows.
  const bool alone =
      level == 0 && patch_ == nullptr && task_.to.convention == TexelConvention::half_texel;
  light->add(part.mean(), alone ? part.omega : solid_angle(cell));
}

TexelGatherer::Uneven TexelGatherer::smooths_unevenly(const CellOutline& outline) const {
  constexpr double kEven = 0.2;
  if (allowed_ > kNotAsked) return {};
  double share[4];
  for (size_t i = 0; i < 4; ++i) share[i] = smooth_share(outline.span_at(i));
  const double first = std::max(std::abs(share[0] - share[1]), std::abs(share[3] - share[2]));
  const double second = std::max(std::abs(share[0] - share[3]), std::abs(share[1] - share[2]));
  return {first > kEven, second > kEven};
}

// An edge that bends by d at its middle shifts a sliver of 2/3 of its length times d from one side
// to the other; opposite edges bend alike. Across a slender cell it shifts no more than 2/3 d of
// what lies on either side of a border, but where opposite edges bend unlike, by e, the cell is
// wider or narrower than it seems, and 2/3 e over its width is the share of the light that is moved
// along.
TexelGatherer::Bend TexelGatherer::bend_of(const TargetCell& cell, const CellOutline& outline) {
  const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
  const CellCorner top = look_up(x, cell.y0), left = look_up(cell.x0, y), centre = look_up(x, y);
  if (!top.covered || !left.covered || !centre.covered) return {1, 1, 1};
  const auto& p = outline.points;
  const auto bend = [&](const CellCorner& corner, const GridPoint& straight) {
    GridPoint bent{corner.place.x - straight.x, corner.place.y - straight.y};
    if (task_.turn > 0) bent.x -= task_.turn * std::nearbyint(bent.x / task_.turn);
    return bent;
  };
  const GridPoint along = bend(top, middle(p[0], p[1])), down = bend(left, middle(p[0], p[3]));
  // Of the middle: what the other two edges bend by where these are straight.
  const GridPoint rest = bend(centre, middle(middle(p[0], p[1]), middle(p[2], p[3])));
  const auto across = [&](const GridPoint& bent, double side_x, double side_y) {
    return std::abs(bent.x * side_y - bent.y * side_x) / std::max(outline.area, 1e-300);
  };
  const double slivers =
      4.0 / 3.0 *
      (std::max(across(along, outline.ax, outline.ay), across(rest, outline.ax, outline.ay)) +
       std::max(across(down, outline.bx, outline.by), across(rest, outline.bx, outline.by)));
  const double shift = std::hypot(along.x, along.y) + std::hypot(down.x, down.y);
  const auto seen = [](double bent) {
    constexpr double kShown = 0.25;  // shifts of opposite edges that cancel, and luck
    return bent * std::min(1.0, kShown + 4 * bent);
  };
  Bend found;
  found.between_samples = seen(2.0 / 3.0 * shift);
  found.among_texels = seen(std::min(1.0, slivers));
  if (!outline.slender()) return found;
  const CellCorner bottom = look_up(x, cell.y1), right = look_up(cell.x1, y);
  if (!bottom.covered || !right.covered) return {1, 1, 1};
  const GridPoint along_end = bend(bottom, middle(p[3], p[2]));
  const GridPoint down_end = bend(right, middle(p[1], p[2]));
  const GridPoint wider{along_end.x - along.x, along_end.y - along.y};
  const GridPoint higher{down_end.x - down.x, down_end.y - down.y};
  // Edges that do not lie beside each other but one behind the other do so by bending alike.
  const double behind = std::abs(outline.ax * outline.bx + outline.ay * outline.by);
  const double first = outline.ax * outline.ax + outline.ay * outline.ay;
  const double second = outline.bx * outline.bx + outline.by * outline.by;
  const double unlike =
      std::max(across(wider, outline.ax, outline.ay), across(wider, outline.bx, outline.by)) +
      std::max(across(higher, outline.ax, outline.ay), across(higher, outline.bx, outline.by)) +
      std::min(1.0, behind / std::max(first, 1e-300)) * across(along, outline.ax, outline.ay) +
      std::min(1.0, behind / std::max(second, 1e-300)) * across(down, outline.bx, outline.by);
  // What is moved differs by no more than values do over the cell's length.
  const double length = std::max(outline.first_length(), outline.second_length());
  found.among_texels = seen(std::min({1.0, slivers, 4.0 / 3.0 * shift}));
  found.within = 0.5 * std::min(1.0, 2.0 / 3.0 * unlike) * std::min(1.0, length);
  return found;
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

// Between four samples the interpolation is a polynomial, and its integral over the part of the
// polygon there follows from the part's moments: on the grid of samples, half a texel off that of
// texels. False where not all samples are inside the image and show something, or the polygon has
// no area.
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
  const double before = light->omega;
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
  return light->omega > before;
}

// n points a texel's side miss the integral of an interpolation by about 0.1 / n^2.
double TexelGatherer::fineness() const {
  return std::clamp(std::sqrt(0.05 / allowed_), 1.0, 10.0);
}

// At places interpolated between the corners.
void TexelGatherer::add_points(const TargetCell& cell, const CellOutline& outline, double share,
                               int level, GatheredLight* light) {
  const auto& p = outline.points;
  const int most = std::max(2, 32 >> level);
  const auto count = [&](double length) {
    return std::clamp(static_cast<int>(std::ceil(fineness() * length)), 1, most);
  };
  const int columns = count(outline.first_length()), rows = count(outline.second_length());
  const double width = cell.x1 - cell.x0, height = cell.y1 - cell.y0;
  const double area = share * width * height / (columns * rows);
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
