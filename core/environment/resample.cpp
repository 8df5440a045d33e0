// Solid angle is d(longitude) d(cos theta). A narrow strip of longitudes inside one column of the
// map is walked from pole to pole: every border of a cube texel and of a map row that it crosses is
// a value of y = cos theta, so a cell's share of the strip is a sum of radiance times differences
// of y. The strips tile the sphere and each strip's cells tile the strip: nothing is lost between
// cells.

#include "core/environment/resample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"

namespace lightkiln {

namespace {

// Faces around the equator with the u of their centres; u grows with s on all four.
struct SideFace {
  int face;
  double centre;
};
constexpr std::array<SideFace, 4> kSides = {{{0, 0.25}, {1, 0.75}, {4, 0.5}, {5, 1.0}}};

// A strip of longitudes seen from its side face: angles `begin` < `end` off the face's centre.
struct Strip {
  double begin, end;
  int column;  // of the map
};

struct Sums {
  Vec3d energy;
  double omega = 0;
};

// Walks one column of the map away from a pole: y = |cos theta| falls from 1, and on to -1 when the
// whole meridian is walked. From the south pole the rows are read upwards.
class ColumnWalk {
 public:
  ColumnWalk(const Image& map, const std::vector<double>& row_edges, int column, bool from_south)
      : map_(map), edges_(row_edges), column_(column), from_south_(from_south) {}

  void start(double y) {
    const auto below = std::upper_bound(edges_.begin(), edges_.end(), y, std::greater<>());
    row_ = std::clamp(static_cast<int>(below - edges_.begin()) - 1, 0, map_.height - 1);
    y_ = y;
  }
  // Adds the part from the present place to `y`, times `width` of longitude.
  void advance(double y, double width, Sums* sums) {
    if (y >= y_) return;
    sums->omega += width * (y_ - y);
    while (row_ + 1 < map_.height && edges_[static_cast<size_t>(row_) + 1] > y) {
      const double edge = edges_[static_cast<size_t>(row_) + 1];
      sums->energy += radiance() * (width * (y_ - edge));
      y_ = edge;
      ++row_;
    }
    sums->energy += radiance() * (width * (y_ - y));
    y_ = y;
  }

 private:
  Vec3d radiance() const {
    return to_double(map_.rgb(column_, from_south_ ? map_.height - 1 - row_ : row_));
  }

  const Image& map_;
  const std::vector<double>& edges_;
  int column_;
  bool from_south_;
  int row_ = 0;
  double y_ = 1;
};

// Strips of texel column i of a side face: cut where the map's columns change and into pieces no
// wider than `widest`.
std::vector<Strip> strips(const SideFace& side, int i, int size, int width, double widest) {
  const double begin = std::atan(2.0 * i / size - 1), end = std::atan(2.0 * (i + 1) / size - 1);
  const auto column_of = [&](double angle) { return (side.centre + angle / (2 * kPi)) * width; };
  std::vector<Strip> result;
  double from = begin;
  // A border that coincides with the texel's own makes an empty strip, which is left out.
  for (int k = static_cast<int>(std::floor(column_of(begin))); from < end; ++k) {
    const double border = ((k + 1.0) / width - side.centre) * 2 * kPi;
    const double to = std::min(end, border);
    if (to - from < 1e-13) {
      if (to >= end) break;
      continue;
    }
    const int pieces = std::max(1, static_cast<int>(std::ceil((to - from) / widest)));
    for (int piece = 0; piece < pieces; ++piece) {
      const double a = from + (to - from) * piece / pieces;
      const double b = from + (to - from) * (piece + 1) / pieces;
      result.push_back({a, b, ((k % width) + width) % width});
    }
    from = to;
  }
  return result;
}

// The mean over a strip [b0, b1] of y on the line tan(latitude) = slope cos(b), an edge of a side
// face, is (F(b1) - F(b0)) / (b1 - b0) with
//   F(b) = integral slope cos b / sqrt(1 + slope^2 cos^2 b) db = asin(k sin b),
//   k = slope / sqrt(1 + slope^2).
double edge_integral(double slope, double b) {
  return std::asin(slope / std::sqrt(1 + slope * slope) * std::sin(b));
}
double mean_edge(double slope, const Strip& strip) {
  return (edge_integral(slope, strip.end) - edge_integral(slope, strip.begin)) /
         (strip.end - strip.begin);
}

void write(const Sums& sums, float* out) {
  for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(sums.energy[c] / sums.omega);
}

struct Task {
  const Image& map;
  int size;
  std::vector<double> row_edges;  // cos theta, descending, symmetric about 0
};

// Edges are averaged exactly over a strip, so strips need not be narrower than the map's columns.
void fill_side_column(const Task& task, int i, Image* cube) {
  const size_t size = static_cast<size_t>(task.size);
  std::vector<Sums> cells(size);
  std::vector<double> from(size + 1), to(size + 1);
  const auto integrals = [&](double b, std::vector<double>& out) {
    for (size_t j = 0; j <= size; ++j) {
      out[j] = edge_integral(1 - 2 * static_cast<double>(j) / task.size, b);
    }
  };
  for (const SideFace& side : kSides) {
    std::fill(cells.begin(), cells.end(), Sums{});
    double last = std::numeric_limits<double>::quiet_NaN();
    for (const Strip& strip : strips(side, i, task.size, task.map.width, kPi)) {
      if (strip.begin != last) integrals(strip.begin, from);
      integrals(strip.end, to);
      const double width = strip.end - strip.begin;
      ColumnWalk walk(task.map, task.row_edges, strip.column, false);
      walk.start((to[0] - from[0]) / width);
      for (size_t j = 0; j < size; ++j) {
        walk.advance((to[j + 1] - from[j + 1]) / width, width, &cells[j]);
      }
      from.swap(to);
      last = strip.end;
    }
    for (size_t j = 0; j < size; ++j) {
      write(cells[j], cube->at(i, side.face * task.size + static_cast<int>(j)));
    }
  }
}

// Strips on a pole face, per cube texel: cells are told apart at the strip's middle.
constexpr double kPoleStrip = 0.25;

// The cells of a pole face along the ray at longitude phi: the ray leaves the centre and crosses
// grid lines at radii rho = tan theta, in order from two arithmetic sequences.
struct PoleRay {
  double step_s, step_t;  // of (2s - 1, 2t - 1) per unit of rho
  int s, t;               // present cell
  int size;
  double next_s, next_t;  // rho of the next crossing

  PoleRay(double phi, bool north, int size_)
      : step_s(std::sin(phi)), step_t(north ? -std::cos(phi) : std::cos(phi)), size(size_) {
    s = step_s > 0 ? size / 2 : (size + 1) / 2 - 1;
    t = step_t > 0 ? size / 2 : (size + 1) / 2 - 1;
    next_s = crossing(step_s, s);
    next_t = crossing(step_t, t);
  }
  double crossing(double step, int cell) const {
    if (step == 0) return std::numeric_limits<double>::infinity();
    const int line = step > 0 ? cell + 1 : cell;
    return (2.0 * line / size - 1) / step;
  }
  // Moves to the next cell and gives the rho at which it begins; *inside says whether it is on
  // the face.
  double leave_cell(bool* inside) {
    if (next_s <= next_t) {
      const double rho = next_s;
      s += step_s > 0 ? 1 : -1;
      next_s = crossing(step_s, s);
      *inside = s >= 0 && s < size;
      return rho;
    }
    const double rho = next_t;
    t += step_t > 0 ? 1 : -1;
    next_t = crossing(step_t, t);
    *inside = t >= 0 && t < size;
    return rho;
  }
};

void fill_pole(const Task& task, bool north, Image* cube, Progress& progress) {
  const int size = task.size, face = north ? 2 : 3;
  std::vector<Sums> cells(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (const SideFace& side : kSides) {
    for (int i = 0; i < size; ++i) {
      if (i % 64 == 0) progress.update(0.5);
      for (const Strip& strip : strips(side, i, size, task.map.width, kPoleStrip / size)) {
        const double width = strip.end - strip.begin;
        const double u = side.centre + 0.5 * (strip.begin + strip.end) / (2 * kPi);
        PoleRay ray(kPi * (1 - 2 * u), north, size);
        ColumnWalk walk(task.map, task.row_edges, strip.column, !north);
        walk.start(1);
        // The last cell ends where the side face begins.
        const double rim = mean_edge(1, strip);
        for (bool inside = true; inside;) {
          const size_t cell = static_cast<size_t>(ray.t * size + ray.s);
          const double rho = ray.leave_cell(&inside);
          const double y = inside ? std::max(rim, 1 / std::sqrt(1 + rho * rho)) : rim;
          walk.advance(y, width, &cells[cell]);
        }
      }
    }
  }
  for (int t = 0; t < size; ++t) {
    for (int s = 0; s < size; ++s) {
      write(cells[static_cast<size_t>(t * size + s)], cube->at(s, face * size + t));
    }
  }
}

}  // namespace

Image resample_to_cube(const Image& latlong, int face_size, int threads, Progress& progress) {
  Task task{latlong, face_size, {}};
  const int height = latlong.height;
  for (int row = 0; row <= height; ++row) {
    const int nearer = std::min(row, height - row);
    const double edge = 2 * nearer == height ? 0.0 : std::cos(kPi * nearer / height);
    task.row_edges.push_back(2 * row <= height ? edge : -edge);
  }
  Image cube(face_size, 6 * face_size, 3);
  parallel_blocks(
      static_cast<size_t>(face_size), 4, threads, progress,
      [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) fill_side_column(task, static_cast<int>(i), &cube);
      },
      0.0, 0.5);
  parallel_blocks(
      2, 1, threads, progress,
      [&](size_t begin, size_t) { fill_pole(task, begin == 0, &cube, progress); }, 0.5, 1.0);
  return cube;
}

}  // namespace lightkiln
