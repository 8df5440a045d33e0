// Every texel of the target is cut into cells whose four corners lie on one piece of the source's
// picture; a cell is then a small polygon there. Cells share corners, so that they tile the source:
// every source texel is dealt out completely, which is what keeps energy.

#include "core/environment/layout_convert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/environment/layout_sample.h"
#include "core/environment/polygon_coverage.h"
#include "core/environment/resample.h"
#include "core/sphere/cube_cross.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/texel_density.h"

namespace lightkiln {

namespace {

// A point of the target's image and where the source shows it.
struct Corner {
  bool shown = false;    // the target shows a direction here
  bool covered = false;  // and the source covers it
  MapPlace place;
};

// Corners of a rectangle of the target: top left, top right, bottom right, bottom left.
struct Cell {
  double x0, y0, x1, y1;
  std::array<Corner, 4> corners;
};

struct Sums {
  Vec3d energy;
  double omega = 0;

  void add(const Vec3d& radiance, double weight) {
    energy += radiance * weight;
    omega += weight;
  }
};

struct Task {
  const MapLayout& from;
  const Image& source;
  const MapLayout& to;
  const Rotation& rotation;
  MapFilter filter;
  TexelDensity density;  // of the source
  bool turned;
  int turn;               // columns of a whole turn of the source, 0 = it does not close
  int least;              // of halving any texel: cells wider than 4 degrees have curved edges
  int depth;              // of halving a cell that straddles a seam
  double span_x, span_y;  // the widest cell that is taken for a polygon, in source texels
};

Corner locate(const Task& task, double x, double y) {
  Corner corner;
  const std::optional<Vec3d> direction = layout_direction(task.to, x, y);
  if (!direction) return corner;
  corner.shown = true;
  const std::optional<MapPlace> place =
      layout_place(task.from, task.turned ? task.rotation.undo(*direction) : *direction);
  if (!place) return corner;
  corner.covered = true;
  corner.place = *place;
  return corner;
}

// The corners as a polygon of the source's picture; false when they are not on one piece of it or
// lie too far apart for straight edges.
bool outline(const Task& task, const std::array<Corner, 4>& corners,
             std::array<GridPoint, 4>* points) {
  int chart = 0;
  for (size_t i = 0; i < 4; ++i) {
    if (!corners[i].shown || !corners[i].covered) return false;
    const MapPlace& place = corners[i].place;
    if (place.chart != 0) {
      if (chart != 0 && chart != place.chart) return false;
      chart = place.chart;
    }
    (*points)[i] = {place.x, place.y};
    if (task.turn > 0 && i > 0) {
      (*points)[i].x -= task.turn * std::nearbyint((place.x - (*points)[0].x) / task.turn);
    }
  }
  for (size_t i = 0; i < 4; ++i) {
    const GridPoint &a = (*points)[i], &b = (*points)[(i + 1) % 4];
    if (std::abs(a.x - b.x) > task.span_x || std::abs(a.y - b.y) > task.span_y) return false;
  }
  return true;
}

// The two sides of a cell in source texels, and the smaller extent of that parallelogram: the
// smaller singular value of the matrix of both.
struct Footprint {
  double along_x, along_y, smaller;
};
Footprint footprint(const std::array<GridPoint, 4>& p) {
  const double ax = 0.5 * (p[1].x - p[0].x + p[2].x - p[3].x);
  const double ay = 0.5 * (p[1].y - p[0].y + p[2].y - p[3].y);
  const double bx = 0.5 * (p[3].x - p[0].x + p[2].x - p[1].x);
  const double by = 0.5 * (p[3].y - p[0].y + p[2].y - p[1].y);
  const double trace = ax * ax + ay * ay + bx * bx + by * by, area = ax * by - ay * bx;
  const double root = std::sqrt(std::max(0.0, trace * trace - 4 * area * area));
  return {std::hypot(ax, ay), std::hypot(bx, by), std::sqrt(std::max(0.0, (trace - root) / 2))};
}

// One thread's work on texels of the target.
class Gatherer {
 public:
  explicit Gatherer(const Task& task) : task_(task) {}

  void texel(const Cell& cell, Sums* sums) { add(cell, 0, sums); }

 private:
  // Level 0 is the whole texel.
  void add(const Cell& cell, int level, Sums* sums) {
    std::array<GridPoint, 4> points;
    if (level >= task_.least && outline(task_, cell.corners, &points)) {
      add_polygon(cell, points, level, sums);
    } else if (level == task_.depth) {
      add_point(cell, sums);
    } else {
      split(cell, level, sums);
    }
  }

  void add_polygon(const Cell& cell, const std::array<GridPoint, 4>& points, int level,
                   Sums* sums) {
    double smooth = 0;
    const Footprint print = footprint(points);
    if (task_.filter == MapFilter::adaptive) {
      smooth = std::clamp(3 - 2 * std::ldexp(print.smaller, level), 0.0, 1.0);
    }
    if (smooth < 1) add_area(cell, points, 1 - smooth, sums);
    if (smooth > 0) add_smooth(cell, points, print, smooth, level, sums);
  }

  void add_area(const Cell& cell, const std::array<GridPoint, 4>& points, double share,
                Sums* sums) {
    coverage_.cover(points.data(), points.size());
    const double before = sums->omega;
    const int turn = task_.turn;
    for (int y = coverage_.top(); y <= coverage_.bottom(); ++y) {
      const int row = std::clamp(y, 0, task_.from.height - 1);
      for (int x = coverage_.left(); x <= coverage_.right(); ++x) {
        const double area = coverage_.area(x, y);
        if (area <= 0) continue;
        const int column =
            turn > 0 ? ((x % turn) + turn) % turn : std::clamp(x, 0, task_.from.width - 1);
        sums->add(to_double(task_.source.rgb(column, row)),
                  share * area * task_.density(column, row));
      }
    }
    // All of it on texels of a rim whose samples lie outside.
    if (sums->omega == before) add_point(cell, sums);
  }

  // Four points per source texel's side (no more than 64 per side of the whole texel), whose sum
  // misses the integral of a bilinear tent by less than 1 / (4 pi)^2 of it, at places interpolated
  // between the corners.
  void add_smooth(const Cell& cell, const std::array<GridPoint, 4>& p, const Footprint& print,
                  double share, int level, Sums* sums) {
    const int most = std::max(1, 64 >> level);  // a texel's side
    const int columns = std::clamp(static_cast<int>(std::ceil(4 * print.along_x)), 1, most);
    const int rows = std::clamp(static_cast<int>(std::ceil(4 * print.along_y)), 1, most);
    const double weight = share * target_omega(cell) / (columns * rows);
    int chart = 0;
    for (const Corner& corner : cell.corners) chart = std::max(chart, corner.place.chart);
    for (int j = 0; j < rows; ++j) {
      const double t = (j + 0.5) / rows;
      const GridPoint left{p[0].x + t * (p[3].x - p[0].x), p[0].y + t * (p[3].y - p[0].y)};
      const GridPoint right{p[1].x + t * (p[2].x - p[1].x), p[1].y + t * (p[2].y - p[1].y)};
      for (int i = 0; i < columns; ++i) {
        const double s = (i + 0.5) / columns;
        MapPlace place{left.x + s * (right.x - left.x), left.y + s * (right.y - left.y), chart};
        if (task_.turn > 0) {
          const double start = task_.from.convention == TexelConvention::openexr ? 0.5 : 0;
          place.x -= task_.turn * std::floor((place.x - start) / task_.turn);
        }
        sums->add(smooth_radiance(task_.from, task_.source, place), weight);
      }
    }
  }

  void add_point(const Cell& cell, Sums* sums) {
    const Corner centre = locate(task_, 0.5 * (cell.x0 + cell.x1), 0.5 * (cell.y0 + cell.y1));
    if (!centre.shown) return;
    Vec3d radiance;
    if (centre.covered) {
      radiance = (task_.filter == MapFilter::area ? nearest_radiance : smooth_radiance)(
          task_.from, task_.source, centre.place);
    }
    sums->add(radiance, target_omega(cell));
  }

  void split(const Cell& cell, int level, Sums* sums) {
    const double x = 0.5 * (cell.x0 + cell.x1), y = 0.5 * (cell.y0 + cell.y1);
    const Corner top = locate(task_, x, cell.y0), left = locate(task_, cell.x0, y);
    const Corner right = locate(task_, cell.x1, y), bottom = locate(task_, x, cell.y1);
    const Corner centre = locate(task_, x, y);
    bool any = centre.shown || top.shown || left.shown || right.shown || bottom.shown;
    for (const Corner& corner : cell.corners) any = any || corner.shown;
    if (!any) return;
    const auto& [c0, c1, c2, c3] = cell.corners;
    add({cell.x0, cell.y0, x, y, {c0, top, centre, left}}, level + 1, sums);
    add({x, cell.y0, cell.x1, y, {top, c1, right, centre}}, level + 1, sums);
    add({x, y, cell.x1, cell.y1, {centre, right, c2, bottom}}, level + 1, sums);
    add({cell.x0, y, x, cell.y1, {left, centre, bottom, c3}}, level + 1, sums);
  }

  double target_omega(const Cell& cell) const {
    return (cell.x1 - cell.x0) * (cell.y1 - cell.y0) *
           solid_angle_density(task_.to, 0.5 * (cell.x0 + cell.x1), 0.5 * (cell.y0 + cell.y1));
  }

  const Task& task_;
  PolygonCoverage coverage_;
};

// A rectangle of the target that is one picture: a face, or the whole image.
struct Block {
  int x, y, columns, rows;
};
std::vector<Block> blocks_of(const MapLayout& layout) {
  if (!is_cube(layout.kind)) return {{0, 0, layout.width, layout.height}};
  const int size = cube_face_size(layout);
  std::vector<Block> blocks;
  for (int face = 0; face < 6; ++face) {
    const FacePlace place = face_place(layout.kind, face);
    blocks.push_back({place.column * size, place.row * size, size, size});
  }
  return blocks;
}

// Lines between texels, held off borders that belong to two faces or are all one direction (the
// poles, whose longitude would be lost), and off what lies beyond the samples of the openexr
// convention.
double grid_line(const MapLayout& layout, int line, int start, int count) {
  const double margin = layout.convention == TexelConvention::openexr ? 0.5 : 0.0;
  return std::clamp(static_cast<double>(line), start + margin + 1e-9,
                    start + count - margin - 1e-9);
}

void write(const Sums& sums, float* out) {
  for (int c = 0; c < 3; ++c) {
    out[c] = sums.omega > 0 ? static_cast<float>(sums.energy[c] / sums.omega) : 0.0f;
  }
}

std::vector<Corner> corner_line(const Task& task, const Block& block, int line) {
  const double y = grid_line(task.to, line, block.y, block.rows);
  std::vector<Corner> corners;
  corners.reserve(static_cast<size_t>(block.columns) + 1);
  for (int x = block.x; x <= block.x + block.columns; ++x) {
    corners.push_back(locate(task, grid_line(task.to, x, block.x, block.columns), y));
  }
  return corners;
}

Cell make_cell(const Task& task, const Block& block, int x, int y,
               const std::array<Corner, 4>& corners) {
  return {grid_line(task.to, x, block.x, block.columns), grid_line(task.to, y, block.y, block.rows),
          grid_line(task.to, x + 1, block.x, block.columns),
          grid_line(task.to, y + 1, block.y, block.rows), corners};
}

void fill_rows(const Task& task, const Block& block, int first, int end, Image* image) {
  Gatherer gatherer(task);
  std::vector<Corner> above = corner_line(task, block, first);
  for (int y = first; y < end; ++y) {
    std::vector<Corner> below = corner_line(task, block, y + 1);
    for (int x = block.x; x < block.x + block.columns; ++x) {
      const size_t i = static_cast<size_t>(x - block.x);
      Sums sums;
      gatherer.texel(make_cell(task, block, x, y, {above[i], above[i + 1], below[i + 1], below[i]}),
                     &sums);
      write(sums, image->at(x, y));
    }
    above.swap(below);
  }
}

// The texels that show one direction in the openexr convention, in one order whichever of them is
// asked for: the last column repeats the first, the first and last rows are the poles, and faces
// share their borders.
struct Texel {
  int x, y;
};
std::vector<Texel> repeats(const MapLayout& layout, int x, int y) {
  if (layout.kind == LayoutKind::latlong) {
    if (y > 0 && y < layout.height - 1) return {{0, y}, {layout.width - 1, y}};
    std::vector<Texel> row;
    for (int i = 0; i < layout.width; ++i) row.push_back({i, y});
    return row;
  }
  const int last = layout.width - 1;
  const Vec3d d = layout_direction(layout, x + 0.5, y + 0.5).value();
  const double largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  std::vector<Texel> texels;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(d[axis]) < largest * (1 - 1e-9)) continue;
    Vec3d towards = d;
    towards[axis] *= 1 + 1e-8;
    int face = 0;
    double u = 0, v = 0;
    cube_coordinates(towards, &face, &u, &v);
    texels.push_back({static_cast<int>(std::lround(u * last)),
                      face * layout.width + static_cast<int>(std::lround(v * last))});
  }
  return texels;
}

// Border texels of the openexr convention: each is the mean over all parts of its cell, which lie
// at every place that repeats it.
void fill_borders(const Task& task, const Block& block, Image* image, Progress& progress) {
  Gatherer gatherer(task);
  const int right = block.x + block.columns - 1, bottom = block.y + block.rows - 1;
  const bool poles = task.to.kind == LayoutKind::latlong;
  for (int y = block.y; y <= bottom; ++y) {
    progress.check();
    const bool edge_row = y == block.y || y == bottom;
    for (int x = block.x; x <= right; x = edge_row || x == right ? x + 1 : right) {
      if (poles && edge_row && x > block.x) {
        std::copy_n(image->at(block.x, y), 3, image->at(x, y));
        continue;
      }
      Sums sums;
      for (const Texel& texel : repeats(task.to, x, y)) {
        const Block own =
            poles ? block
                  : Block{0, texel.y / block.columns * block.columns, block.columns, block.columns};
        Cell cell = make_cell(task, own, texel.x, texel.y, {});
        cell.corners = {locate(task, cell.x0, cell.y0), locate(task, cell.x1, cell.y0),
                        locate(task, cell.x1, cell.y1), locate(task, cell.x0, cell.y1)};
        gatherer.texel(cell, &sums);
      }
      write(sums, image->at(x, y));
    }
  }
}

double mean_pitch(const MapLayout& layout) {
  const int size = is_cube(layout.kind) ? cube_face_size(layout) : 0;
  const double texels = size > 0 ? 6.0 * size * size : 1.0 * layout.width * layout.height;
  return std::sqrt(covered_solid_angle(layout) / texels);
}

Task make_task(const MapLayout& from, const Image& source, const MapLayout& to,
               const Rotation& rotation, MapFilter filter) {
  Task task{from,
            source,
            to,
            rotation,
            filter,
            TexelDensity(from),
            !rotation.is_identity(),
            turn_columns(from),
            0,
            0,
            0,
            0};
  // Cells at a seam end at an eighth of a source texel.
  const double ratio = mean_pitch(to) / mean_pitch(from);
  constexpr double kStraight = 0.07;  // radians
  task.least = std::clamp(static_cast<int>(std::ceil(std::log2(mean_pitch(to) / kStraight))), 0, 6);
  task.depth = std::clamp(static_cast<int>(std::ceil(std::log2(8 * ratio))), 3, 9);
  // Straight edges: within 1/48 of a turn along rows, 1/96 of the sphere's half turn otherwise.
  const int size = is_cube(from.kind) ? cube_face_size(from) : from.height;
  task.span_y = std::max(4.0, size / (is_cube(from.kind) ? 24.0 : 96.0));
  task.span_x = task.turn > 0 ? std::max(4.0, from.width / 48.0) : task.span_y;
  return task;
}

void check(const MapLayout& layout, const Image& image) {
  const char* fault = layout_fault(layout);
  if (fault == nullptr && (image.width != layout.width || image.height != layout.height)) {
    fault = "The image has another size than its layout.";
  }
  if (fault == nullptr && image.channels != 3) fault = "The image has no three channels.";
  if (fault != nullptr) throw Error(ErrorCode::invalid_input, fault);
}

// Moves whole faces from one cube layout to another.
Image move_faces(const MapLayout& from, const Image& source, const MapLayout& to) {
  const int size = cube_face_size(from);
  Image image(to.width, to.height, 3);
  for (int face = 0; face < 6; ++face) {
    const FacePlace a = face_place(from.kind, face), b = face_place(to.kind, face);
    const bool turn = a.half_turn != b.half_turn;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const int i = turn ? size - 1 - x : x, j = turn ? size - 1 - y : y;
        std::copy_n(source.at(a.column * size + x, a.row * size + y), 3,
                    image.at(b.column * size + i, b.row * size + j));
      }
    }
  }
  return image;
}

// The closed-form walk of resample.h does what `area` does, at a tenth of the cost, where a cube's
// texels are wide enough to need no smoothing.
bool walks_meridians(const Task& task) {
  return !task.turned && task.from.kind == LayoutKind::latlong && is_cube(task.to.kind) &&
         task.from.convention == TexelConvention::half_texel &&
         task.to.convention == TexelConvention::half_texel &&
         (task.filter == MapFilter::area || 8 * cube_face_size(task.to) <= task.from.width);
}

}  // namespace

bool moves_texels(const MapLayout& from, const MapLayout& to, const Rotation& rotation) {
  if (!rotation.is_identity()) return false;
  return from == to ||
         (is_cube(from.kind) && is_cube(to.kind) && from.convention == to.convention &&
          cube_face_size(from) == cube_face_size(to));
}

Image convert_layout(const MapLayout& from, const Image& source, const MapLayout& to,
                     const Rotation& rotation, MapFilter filter, int threads, Progress& progress) {
  check(from, source);
  if (layout_fault(to) != nullptr) throw Error(ErrorCode::invalid_input, layout_fault(to));
  if (moves_texels(from, to, rotation)) {
    return from == to ? source : move_faces(from, source, to);
  }
  const Task task = make_task(from, source, to, rotation, filter);
  if (walks_meridians(task)) {
    const int size = cube_face_size(to);
    return move_faces(make_layout(LayoutKind::cube_strip, size),
                      resample_to_cube(source, size, threads, progress), to);
  }
  Image image(to.width, to.height, 3);
  const std::vector<Block> blocks = blocks_of(to);
  const size_t rows = static_cast<size_t>(blocks[0].rows);
  constexpr size_t kRows = 8;
  const size_t groups = (rows + kRows - 1) / kRows;
  parallel_blocks(groups * blocks.size(), 1, threads, progress, [&](size_t group, size_t) {
    const Block& block = blocks[group / groups];
    const size_t first = group % groups * kRows;
    fill_rows(task, block, block.y + static_cast<int>(first),
              block.y + static_cast<int>(std::min(rows, first + kRows)), &image);
  });
  if (to.convention == TexelConvention::openexr) {
    for (const Block& block : blocks) fill_borders(task, block, &image, progress);
  }
  return image;
}

}  // namespace lightkiln
