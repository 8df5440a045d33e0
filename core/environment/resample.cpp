// Solid angle is d(longitude) d(y), y = cos theta. With S(phi, y) the integral of a column's
// radiance from the pole down to y, the energy of a cell is the integral of S dphi around its
// border (Green's theorem): its share of the map is known from curves alone, and meridians add
// nothing.
//
// Every other line of a cube's grid is a great circle, tan(latitude) = A cos b, b the longitude
// from its summit. Along it y = A cos b / sqrt(1 + A^2 cos^2 b), whose integral is
//   E(b) = asin(k sin b),  k = A / sqrt(1 + A^2),
// and inside one texel of the map S = Q - L y, so that a piece of line gives Q db - L dE: no point
// is sampled, and nothing but rounding is lost.

#include "core/environment/resample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

// Faces around the equator with the u of their centres; u grows with s on all four. A pole face is
// made of four sectors, each below one of them.
struct SideFace {
  int face;
  double centre;
};
constexpr std::array<SideFace, 4> kSides = {{{0, 0.25}, {1, 0.75}, {4, 0.5}, {5, 1.0}}};

// What all cells share. Rows are counted from the pole that S starts at; borders of rows lie
// symmetrically about the equator.
struct Grid {
  const Image& map;
  int size;
  CubeSolidAngles solid_angles;
  std::vector<double> y, tangent;  // of the latitude of each row's upper border, height + 1

  Grid(const Image& latlong, int face_size)
      : map(latlong), size(face_size), solid_angles(face_size) {
    const int height = map.height;
    for (int row = 0; row <= height; ++row) {
      const int nearer = std::min(row, height - row);
      const double theta = kPi * nearer / height, sign = 2 * row <= height ? 1 : -1;
      const bool equator = 2 * nearer == height;
      y.push_back(equator ? 0.0 : sign * std::cos(theta));
      tangent.push_back(nearer == 0 ? sign * kNever
                        : equator   ? 0.0
                                    : sign * std::cos(theta) / std::sin(theta));
    }
  }
  int row_of(double latitude_tangent) const {
    const double theta = kPi / 2 - std::atan(latitude_tangent);
    return std::clamp(static_cast<int>(theta * map.height / kPi), 0, map.height - 1);
  }
};

// S = constant - radiance y inside each texel of some columns, for the rows [first_row, last_row].
class ColumnSums {
 public:
  struct Texel {
    Vec3d constant, radiance;
  };

  ColumnSums(const Grid& grid, int first_column, int last_column, int first_row, int last_row,
             bool from_south)
      : first_column_(first_column),
        first_row_(first_row),
        rows_(last_row - first_row + 1),
        texels_(static_cast<size_t>(last_column - first_column + 1) * static_cast<size_t>(rows_)) {
    const int width = grid.map.width, height = grid.map.height;
    std::vector<Vec3d> above(static_cast<size_t>(last_column - first_column + 1));
    for (int row = first_row; row <= last_row; ++row) {
      const double top = grid.y[static_cast<size_t>(row)];
      const double tall = top - grid.y[static_cast<size_t>(row) + 1];
      const int line = from_south ? height - 1 - row : row;
      for (int column = first_column; column <= last_column; ++column) {
        const int wrapped = ((column % width) + width) % width;
        const Vec3d radiance = to_double(grid.map.rgb(wrapped, line));
        Vec3d& sum = above[static_cast<size_t>(column - first_column)];
        texels_[index(column, row)] = {sum + radiance * top, radiance};
        sum += radiance * tall;
      }
    }
  }
  const Texel& at(int column, int row) const { return texels_[index(column, row)]; }

 private:
  size_t index(int column, int row) const {
    return static_cast<size_t>(column - first_column_) * static_cast<size_t>(rows_) +
           static_cast<size_t>(row - first_row_);
  }

  int first_column_, first_row_, rows_;
  std::vector<Texel> texels_;
};

// A place on a line: its longitude from the side face's centre, and the sine of that from the
// line's summit.
struct Place {
  double longitude, sine;
};

// A great circle whose summit lies at -1, 0 or 1 quarter turns of those longitudes.
struct Line {
  double height;  // A
  int quarter;
  double summit() const { return quarter * (kPi / 2); }
  double k() const { return height / std::sqrt(1 + height * height); }
  double tangent(double sine) const { return height * std::sqrt((1 - sine) * (1 + sine)); }
};

// Column borders of the map as seen from a side face, from the column before `begin` to the one
// after `end`, with what a walk asks of each.
class Borders {
 public:
  Borders(const SideFace& side, int width, double begin, double end)
      : centre_(side.centre), width_(width), first_(column_of(begin) - 1) {
    for (int column = first_; column <= column_of(end) + 2; ++column) {
      const double at = (double(column) / width - centre_) * 2 * kPi;
      places_.push_back({at, std::sin(at), std::cos(at)});
    }
  }
  int column_of(double longitude) const {
    return static_cast<int>(std::floor((longitude / (2 * kPi) + centre_) * width_));
  }
  int first() const { return first_; }
  int last() const { return first_ + static_cast<int>(places_.size()) - 2; }
  double longitude(int column) const { return at(column).longitude; }
  // Of the longitude from a summit at that many quarter turns.
  double sine(int column, int quarter) const {
    const Border& border = at(column);
    return quarter == 0 ? border.sine : -quarter * border.cosine;
  }

 private:
  struct Border {
    double longitude, sine, cosine;
  };
  const Border& at(int column) const { return places_[static_cast<size_t>(column - first_)]; }

  double centre_;
  int width_, first_;
  std::vector<Border> places_;
};

// Walks along one side of a line's summit, longitude growing, from `from` over every place of
// `ends`, and hands add(i, integral of S dphi) of the stretch that ends at ends[i].
template <typename Ends, typename Add>
void walk(const Grid& grid, const ColumnSums& sums, const Borders& borders, const Line& line,
          const Place& from, const Ends& ends, const Add& add) {
  const double k = line.k();
  const bool rising = from.longitude < line.summit();  // towards it
  // Towards the equator rows grow north of it and fall south of it.
  const int way = (line.height > 0) != rising ? 1 : -1;
  int row = grid.row_of(line.tangent(from.sine));
  int column = borders.column_of(from.longitude);
  double at = from.longitude, integral = std::asin(k * from.sine), next_sine = 0;
  double next_column = borders.longitude(column + 1);
  // The crossing of the next row border: A cos b is its tangent. One that the summit does not reach
  // is never met on the way up; on the way down rounding alone can put it behind the summit.
  const auto next_row_from = [&](double place) {
    if (line.height == 0) return kNever;
    const double ratio = grid.tangent[static_cast<size_t>(row + (way > 0 ? 1 : 0))] / line.height;
    if (ratio > 1 && !rising) return place;
    if (!(ratio >= 0 && ratio <= 1)) return kNever;
    next_sine = (rising ? -1 : 1) * std::sqrt((1 - ratio) * (1 + ratio));
    return std::max(place, line.summit() + (rising ? -1 : 1) * std::acos(ratio));
  };
  double next_row = next_row_from(at);
  for (size_t i = 0; i < ends.size(); ++i) {
    const Place& end = ends[i];
    Vec3d sum;
    for (bool done = false; !done;) {
      const double to = std::min({next_column, next_row, end.longitude});
      const double step = to - at;
      if (step > 0) {
        const double sine = to == end.longitude ? end.sine
                            : to == next_row    ? next_sine
                                                : borders.sine(column + 1, line.quarter);
        const double reached = std::asin(k * sine);
        const ColumnSums::Texel& texel = sums.at(column, row);
        sum += texel.constant * step - texel.radiance * (reached - integral);
        integral = reached;
        at = to;
      }
      done = to == end.longitude;
      if (to == next_column) next_column = borders.longitude(++column + 1);
      if (to == next_row) {
        row += way;
        next_row = next_row_from(at);
      }
    }
    add(i, sum);
  }
}

// Beside a bright texel a black one's rounding must not show as a negative.
void write(const Vec3d& energy, double omega, float* out) {
  for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(std::max(0.0, energy[c] / omega));
}

// Texel columns of a side face whose lines are walked in one go: they lie before their summit, at
// longitude 0, or after it. An odd face has a texel on both sides of it.
struct Stretch {
  Place from;
  std::vector<Place> ends;
  int first;  // texel column that ends[0] ends
};

std::vector<Stretch> side_stretches(int begin, int end, int size) {
  const auto edge = [&](int i) {
    const double s = 2.0 * i / size - 1;
    return Place{std::atan(s), s / std::sqrt(1 + s * s)};
  };
  std::vector<Stretch> stretches;
  Stretch before{edge(begin), {}, begin}, after{{0, 0}, {}, std::max(begin, size / 2)};
  if (2 * begin >= size) after.from = edge(begin);
  for (int i = begin; i < end; ++i) {
    if (2 * i < size) before.ends.push_back(2 * i + 1 == size ? Place{0, 0} : edge(i + 1));
    if (2 * (i + 1) > size) after.ends.push_back(edge(i + 1));
  }
  if (!before.ends.empty()) stretches.push_back(std::move(before));
  if (!after.ends.empty()) stretches.push_back(std::move(after));
  return stretches;
}

// Texel columns [begin, end) of the four side faces. Line j is tan(latitude) = (1 - 2j/size) cos b.
void fill_side_columns(const Grid& grid, int begin, int end, Image* cube) {
  const int size = grid.size;
  std::vector<Vec3d> above(static_cast<size_t>(end - begin)), below = above;
  const int first_row = std::max(0, grid.row_of(1) - 1);
  const int last_row = grid.map.height - 1 - first_row;
  const std::vector<Stretch> stretches = side_stretches(begin, end, size);
  const double west = stretches.front().from.longitude;
  const double east = stretches.back().ends.back().longitude;
  for (const SideFace& side : kSides) {
    const Borders borders(side, grid.map.width, west, east);
    const ColumnSums sums(grid, borders.first(), borders.last(), first_row, last_row, false);
    for (int j = 0; j <= size; ++j) {
      const Line line{1 - 2.0 * j / size, 0};
      std::fill(below.begin(), below.end(), Vec3d{});
      for (const Stretch& stretch : stretches) {
        walk(grid, sums, borders, line, stretch.from, stretch.ends,
             [&](size_t n, const Vec3d& integral) {
               below[static_cast<size_t>(stretch.first - begin) + n] += integral;
             });
      }
      for (int i = begin; i < end && j > 0; ++i) {
        const size_t n = static_cast<size_t>(i - begin);
        write(below[n] - above[n], grid.solid_angles.at(i, j - 1),
              cube->at(i, side.face * size + j - 1));
      }
      above.swap(below);
    }
  }
}

// The sector of a pole face below a side face: xi = rho sin b and eta = rho cos b, rho =
// tan(theta), with |xi| <= eta <= 1. Cells are told by their places along both, as indices of the
// whole face.
struct Sector {
  int size, face;
  double sine, cosine;  // of the side face's own longitude

  Sector(int size_, bool north, const SideFace& side)
      : size(size_),
        face(north ? 2 : 3),
        sine(std::round(std::sin(kPi * (1 - 2 * side.centre)))),
        cosine(std::round(std::cos(kPi * (1 - 2 * side.centre)))) {}
  // 2s - 1 = rho sin(phi) and 2t - 1 = -+ rho cos(phi) with phi the side face's longitude less b.
  size_t cell(int xi, int eta) const {
    const auto turned = [&](double sign, int i) { return sign > 0 ? i : size - 1 - i; };
    const double north = face == 2 ? -1 : 1;
    const int s = cosine != 0 ? turned(-cosine, xi) : turned(sine, eta);
    const int t = cosine != 0 ? turned(north * cosine, eta) : turned(north * sine, xi);
    return static_cast<size_t>(t) * static_cast<size_t>(size) + static_cast<size_t>(s);
  }
  double grid_line(int i) const { return 2.0 * i / size - 1; }
};

// Lines of constant eta: A = 1 / eta, summit at b = 0. What lies inside, towards the pole, gets
// what the line integrates, and what lies outside gives it.
void walk_eta(const Grid& grid, const ColumnSums& sums, const Borders& borders,
              const Sector& sector, int j, std::vector<Vec3d>* cells) {
  const int size = sector.size;
  const double eta = sector.grid_line(j);
  const auto place = [&](double xi) {
    return Place{std::atan(xi / eta), xi / std::sqrt(xi * xi + eta * eta)};
  };
  for (const bool before : {true, false}) {
    std::vector<Place> ends;
    std::vector<int> columns;
    const double from = before ? -eta : 0, to = before ? 0 : eta;
    const int first = static_cast<int>(std::floor((from + 1) / 2 * size + 1e-9));
    for (int xi = first; sector.grid_line(xi) < to - 1e-12; ++xi) {
      ends.push_back(place(std::min(to, sector.grid_line(xi + 1))));
      columns.push_back(xi);
    }
    if (ends.empty()) continue;
    walk(grid, sums, borders, {1 / eta, 0}, place(from), ends,
         [&](size_t n, const Vec3d& integral) {
           (*cells)[sector.cell(columns[n], j - 1)] += integral;
           if (j < size) (*cells)[sector.cell(columns[n], j)] += integral * -1.0;
         });
  }
}

// Lines of constant xi = x: tan(latitude) = sin b / x = cos(b - pi/2) / x, and mirrored for x < 0.
// Along them eta runs between |x|, on the sector's border, and 1.
void walk_xi(const Grid& grid, const ColumnSums& sums, const Borders& borders, const Sector& sector,
             int i, std::vector<Vec3d>* cells) {
  const int size = sector.size;
  const double x = sector.grid_line(i);
  const int side = x > 0 ? 1 : -1;
  if (std::abs(x) < 1e-12) return;  // a meridian
  const Line line{1 / std::abs(x), side};
  const auto place = [&](double eta) {
    return Place{std::atan(x / eta), -side * eta / std::sqrt(x * x + eta * eta)};
  };
  std::vector<Place> ends;
  std::vector<int> rows;
  const int nearest = static_cast<int>(std::floor((std::abs(x) + 1) / 2 * size + 1e-9));
  if (x > 0) {  // b grows as eta falls
    for (int eta = size - 1; eta >= nearest; --eta) {
      ends.push_back(place(std::max(x, sector.grid_line(eta))));
      rows.push_back(eta);
    }
  } else {
    for (int eta = nearest; eta < size; ++eta) {
      ends.push_back(place(sector.grid_line(eta + 1)));
      rows.push_back(eta);
    }
  }
  const int inside = x > 0 ? i - 1 : i, outside = x > 0 ? i : i - 1;
  walk(grid, sums, borders, line, place(x > 0 ? 1 : -x), ends,
       [&](size_t n, const Vec3d& integral) {
         (*cells)[sector.cell(inside, rows[n])] += integral;
         (*cells)[sector.cell(outside, rows[n])] += integral * -1.0;
       });
}

void fill_pole(const Grid& grid, bool north, Image* cube, Progress& progress) {
  const int size = grid.size;
  std::vector<Vec3d> cells(static_cast<size_t>(size) * static_cast<size_t>(size));
  const int last_row = std::min(grid.map.height - 1, grid.row_of(std::sqrt(0.5)) + 1);
  for (const SideFace& side : kSides) {
    const Borders borders(side, grid.map.width, -kPi / 4, kPi / 4);
    const ColumnSums sums(grid, borders.first(), borders.last(), 0, last_row, !north);
    const Sector sector(size, north, side);
    for (int i = 1; i <= size; ++i) {
      if (i % 64 == 0) progress.update(0.5);
      if (2 * i > size) walk_eta(grid, sums, borders, sector, i, &cells);
      if (i < size) walk_xi(grid, sums, borders, sector, i, &cells);
    }
  }
  for (int t = 0; t < size; ++t) {
    for (int s = 0; s < size; ++s) {
      const size_t cell =
          static_cast<size_t>(t) * static_cast<size_t>(size) + static_cast<size_t>(s);
      write(cells[cell], grid.solid_angles.at(s, t), cube->at(s, (north ? 2 : 3) * size + t));
    }
  }
}

}  // namespace

Image resample_to_cube(const Image& latlong, int face_size, int threads, Progress& progress) {
  const Grid grid(latlong, face_size);
  Image cube(face_size, 6 * face_size, 3);
  constexpr size_t kColumns = 8;
  parallel_blocks(
      static_cast<size_t>(face_size), kColumns, threads, progress,
      [&](size_t begin, size_t end) {
        fill_side_columns(grid, static_cast<int>(begin), static_cast<int>(end), &cube);
      },
      0.0, 0.5);
  parallel_blocks(
      2, 1, threads, progress,
      [&](size_t begin, size_t) { fill_pole(grid, begin == 0, &cube, progress); }, 0.5, 1.0);
  return cube;
}

}  // namespace lightkiln
