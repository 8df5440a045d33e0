// Every texel's share of the lobe is known to kTwinError of itself, and no texel is negative: so is
// their sum. Far from the axis two Gauss points a side tell it, nearer three, and about the axis
// and on the horizon texels are integrated one by one.

#include "core/environment/lobe_averages.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/base/math.h"
#include "core/environment/patch_integral.h"

namespace lightkiln {

namespace {

// A row of the map, colour by colour.
struct Row {
  std::vector<double> red, green, blue;
};

LIGHTKILN_CLONES void split(const float* pixels, double* red, double* green, double* blue,
                            size_t count) {
  for (size_t x = 0; x < count; ++x) {
    red[x] = pixels[3 * x];
    green[x] = pixels[3 * x + 1];
    blue[x] = pixels[3 * x + 2];
  }
}

void read_row(const Image& map, int y, Row* row) {
  const size_t width = static_cast<size_t>(map.width);
  for (std::vector<double>* color : {&row->red, &row->green, &row->blue}) color->resize(width);
  split(map.at(0, y), row->red.data(), row->green.data(), row->blue.data(), width);
}

// Eight partial sums of each colour, whatever the machine's vectors hold.
LIGHTKILN_CLONES Vec3d weighted_sum(const double* red, const double* green, const double* blue,
                                    const double* weights, size_t count) {
  constexpr size_t kLanes = 8;
  double sums[3][kLanes] = {};
  const double* colors[3] = {red, green, blue};
  const size_t whole = count - count % kLanes;
  for (int c = 0; c < 3; ++c) {
    for (size_t x = 0; x < whole; x += kLanes) {
      for (size_t k = 0; k < kLanes; ++k) sums[c][k] += weights[x + k] * colors[c][x + k];
    }
    for (size_t x = whole; x < count; ++x) sums[c][0] += weights[x] * colors[c][x];
  }
  Vec3d total;
  for (size_t k = 0; k < kLanes; ++k) total += Vec3d{sums[0][k], sums[1][k], sums[2][k]};
  return total;
}

// Columns [begin, end).
struct Run {
  long begin, end;
  Run within(const Run& other) const {
    const long from = std::clamp(begin, other.begin, other.end);
    return {from, std::clamp(end, from, other.end)};
  }
};

// One axis over the rows of a map. Columns count in the direction of the map's from about the
// meridian opposite the axis, so that those near the axis are one run in the middle.
class AxisSum {
 public:
  AxisSum(const Image& map, const TwinLobe& lobe, const Vec3d& axis);
  // The row's share of the lobe's average.
  Vec3d add_row(const Row& row, int y, std::vector<double>& weights) const;

 private:
  Run none() const;
  Run columns_within(double longitude) const;
  Run columns_inside(double longitude) const;
  Run near(double angle, double top, double bottom) const;
  Run inside(double angle, double top, double bottom) const;
  void fill(const Run& run, size_t rule, int y, double* weights) const;
  void integrate(const Run& run, double top, double bottom, int horizon_points,
                 double* weights) const;

  long width_, height_;
  double step_, row_step_;
  const TwinLobe& lobe_;
  double colatitude_, sine_;  // of the axis
  long first_;                // the map's column, turned round the map at will, that counts as 0
  double middle_;             // where the axis stands, half a column about half the width
  PatchIntegral patches_;
  int horizon_points_ = 0;  // of every texel there; 0 = not one number for all
  // The first rules of kPatchRules serve whole runs: beyond these angles, by these points, as
  // 1 - cos(longitude) of each column.
  static constexpr size_t kRunRules = 2;
  std::array<double, kRunRules> beyond_;
  std::array<std::vector<std::vector<double>>, kRunRules> places_;
};

double colatitude_of(const Vec3d& axis) {
  return std::atan2(std::hypot(axis.x, axis.z), axis.y);
}

// The angle from which on the lobe is at least so wide; pi where it nowhere is.
double angle_of_width(const TwinLobe& lobe, double width) {
  if (lobe.width_rad(0) >= width) return 0;
  double low = 0, high = kPi;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (lobe.width_rad(middle) >= width ? high : low) = middle;
  }
  return high;
}

AxisSum::AxisSum(const Image& map, const TwinLobe& lobe, const Vec3d& axis)
    : width_(map.width),
      height_(map.height),
      step_(2 * kPi / map.width),
      row_step_(kPi / map.height),
      lobe_(lobe),
      colatitude_(colatitude_of(axis)),
      sine_(std::sin(colatitude_)),
      patches_(lobe, colatitude_) {
  const double place = (kPi - std::atan2(axis.x, axis.z)) / step_;
  first_ = static_cast<long>(std::floor(place - 0.5 * static_cast<double>(width_) + 0.5));
  middle_ = place - static_cast<double>(first_);
  constexpr double kLargest = 0.025;  // texels of larger maps all count one by one
  const double side = std::max(step_, row_step_);
  constexpr PatchRule kHorizonRule = kPatchRules[1];
  if (side <= kLargest && lobe.width_rad(kPi / 2 - 4 * side) >= kHorizonRule.shares * side)
    horizon_points_ = kHorizonRule.points;
  for (size_t r = 0; r < kRunRules; ++r) {
    beyond_[r] = side > kLargest ? kPi : angle_of_width(lobe, kPatchRules[r].shares * side);
    if (beyond_[r] == kPi) continue;
    for (const double node : patch_rule(kPatchRules[r].points).nodes) {
      std::vector<double>& places = places_[r].emplace_back(static_cast<size_t>(width_));
      for (size_t i = 0; i < places.size(); ++i) {
        const double s =
            std::sin(0.5 * step_ * (static_cast<double>(i) + 0.5 + 0.5 * node - middle_));
        places[i] = 2 * s * s;
      }
    }
  }
}

Run AxisSum::none() const {
  return {width_ / 2, width_ / 2};
}

// Columns that come at all within a longitude of the axis, and those that lie wholly inside.
Run AxisSum::columns_within(double longitude) const {
  if (longitude <= 0) return none();
  if (longitude >= kPi) return {0, width_};
  const double reach = longitude / step_;
  return Run{static_cast<long>(std::floor(middle_ - reach)),
             static_cast<long>(std::floor(middle_ + reach)) + 1}
      .within({0, width_});
}
Run AxisSum::columns_inside(double longitude) const {
  if (longitude <= 0) return none();
  if (longitude >= kPi) return {0, width_};
  const double reach = longitude / step_;
  return Run{static_cast<long>(std::ceil(middle_ - reach)),
             static_cast<long>(std::floor(middle_ + reach))}
      .within({0, width_});
}

// Columns that come within an angle of the axis between two colatitudes, or a few more: with
// 1 - cos(angle) = (1 - cos(t - u)) + sin t sin u (1 - cos f), the largest f by the nearest t and
// the smallest sin t.
Run AxisSum::near(double angle, double top, double bottom) const {
  if (angle >= kPi) return {0, width_};
  const double s = std::sin(0.5 * angle);
  const double d = std::sin(0.5 * std::max({0.0, top - colatitude_, colatitude_ - bottom}));
  const double left = 2 * (s * s - d * d);
  if (left <= 0) return none();
  const double ring = std::min(std::sin(top), std::sin(bottom)) * sine_;
  if (left >= 2 * ring) return {0, width_};
  return columns_within(2 * std::asin(std::sqrt(0.5 * left / ring)));
}

// Columns that lie wholly within it, or a few less.
Run AxisSum::inside(double angle, double top, double bottom) const {
  const double s = std::sin(0.5 * angle);
  const double d = std::sin(0.5 * std::max(bottom - colatitude_, colatitude_ - top));
  const double left = 2 * (s * s - d * d);
  const double ring =
      sine_ * (top < kPi / 2 && bottom > kPi / 2 ? 1.0 : std::max(std::sin(top), std::sin(bottom)));
  if (left <= 0) return none();
  if (left >= 2 * ring) return {0, width_};
  return columns_inside(2 * std::asin(std::sqrt(0.5 * left / ring)));
}

// Next to a pole sin t is part of what changes: a point more.
void AxisSum::fill(const Run& run, size_t rule, int y, double* weights) const {
  constexpr long kPolar = 16;
  if (run.end <= run.begin) return;
  const bool polar = y < kPolar || y >= height_ - kPolar;
  const int points = kPatchRules[rule].points;
  const GaussRule &across = patch_rule(points), &down = patch_rule(points + (polar ? 1 : 0));
  for (size_t j = 0; j < down.nodes.size(); ++j) {
    const double t = row_step_ * (y + 0.5 + 0.5 * down.nodes[j]), sine = std::sin(t);
    const double s = std::sin(0.5 * (t - colatitude_));
    const double weight = 0.25 * row_step_ * step_ * down.weights[j] * sine;
    for (size_t i = 0; i < across.nodes.size(); ++i) {
      lobe_.add(
          2 * s * s, sine * sine_, weight * across.weights[i],
          std::span(places_[rule][i])
              .subspan(static_cast<size_t>(run.begin), static_cast<size_t>(run.end - run.begin)),
          weights + run.begin);
    }
  }
}

void AxisSum::integrate(const Run& run, double top, double bottom, int horizon_points,
                        double* weights) const {
  for (long i = run.begin; i < run.end; ++i) {
    const double left = step_ * (static_cast<double>(i) - middle_);
    weights[i] += patches_({top, bottom, left, left + step_}, horizon_points);
  }
}

Vec3d AxisSum::add_row(const Row& row, int y, std::vector<double>& weights) const {
  const double top = y * row_step_, bottom = std::min(kPi, (y + 1) * row_step_);
  Run touched{0, width_}, above = touched;
  if (lobe_.has_horizon()) {
    const double a = patches_.horizon_longitude(top), b = patches_.horizon_longitude(bottom);
    touched = columns_within(std::max(a, b));
    above = columns_inside(std::min(a, b)).within(touched);
    if (touched.end <= touched.begin) return {};
  }
  std::fill(weights.begin() + touched.begin, weights.begin() + touched.end, 0.0);
  double* at = weights.data();
  const Run empty = inside(lobe_.empty_rad(), top, bottom).within(above);
  Run outer = above;
  for (size_t rule = 0; rule < kRunRules; ++rule) {
    const Run inner = near(beyond_[rule], top, bottom).within(outer);
    Run left{outer.begin, inner.begin}, right{inner.end, outer.end};
    if (empty.begin < empty.end) {
      left.end = std::min(left.end, empty.begin);
      right.begin = std::max(right.begin, empty.end);
    }
    fill(left, rule, y, at);
    fill(right, rule, y, at);
    outer = inner;
  }
  const Run hole = empty.within(outer);
  integrate({outer.begin, hole.begin}, top, bottom, 0, at);
  integrate({hole.end, outer.end}, top, bottom, 0, at);
  integrate({touched.begin, above.begin}, top, bottom, horizon_points_, at);
  integrate({above.end, touched.end}, top, bottom, horizon_points_, at);
  // Back to the map's own columns.
  Vec3d sum;
  for (long i = touched.begin; i < touched.end;) {
    const long column = ((first_ + i) % width_ + width_) % width_;
    const long count = std::min(touched.end - i, width_ - column);
    sum +=
        weighted_sum(&row.red[static_cast<size_t>(column)], &row.green[static_cast<size_t>(column)],
                     &row.blue[static_cast<size_t>(column)], at + i, static_cast<size_t>(count));
    i += count;
  }
  return sum;
}

// Appends the averages about so few axes that their sums fit in memory.
void add_averages(const Image& map, const TwinLobe& lobe, std::span<const Vec3d> axes, int threads,
                  Progress& progress, std::vector<Vec3d>* means) {
  constexpr size_t kRows = 16;  // summed together
  std::vector<AxisSum> parts;
  for (const Vec3d& axis : axes) parts.emplace_back(map, lobe, axis);
  const size_t height = static_cast<size_t>(map.height), blocks = (height + kRows - 1) / kRows;
  std::vector<Vec3d> sums(blocks * axes.size());
  parallel_blocks(
      height, kRows, threads, progress,
      [&](size_t begin, size_t end) {
        Row row;
        std::vector<double> weights(static_cast<size_t>(map.width));
        for (size_t y = begin; y < end; ++y) {
          read_row(map, static_cast<int>(y), &row);
          for (size_t a = 0; a < parts.size(); ++a) {
            sums[begin / kRows * parts.size() + a] +=
                parts[a].add_row(row, static_cast<int>(y), weights);
          }
        }
      },
      1, 1);
  const size_t first = means->size();
  means->resize(first + axes.size());
  for (size_t i = 0; i < sums.size(); ++i) (*means)[first + i % axes.size()] += sums[i];
}

double brightest(const Vec3d& value) {
  return std::max({value.x, value.y, value.z});
}

}  // namespace

LobeAverages lobe_averages(const Environment& environment, const TwinLobe& lobe,
                           std::span<const Vec3d> axes, int threads, Progress& progress) {
  constexpr size_t kTogether = 16;
  LobeAverages averages;
  for (size_t i = 0; i < axes.size(); i += kTogether) {
    add_averages(environment.radiance, lobe, axes.subspan(i, std::min(kTogether, axes.size() - i)),
                 threads, progress, &averages.means);
  }
  const double mean = brightest(environment.mean);
  double most = 0;
  for (const Vec3d& value : averages.means) most = std::max(most, brightest(value));
  averages.error = kTwinError * (lobe.has_horizon() ? most : 4 * kPi * *lobe.largest() * mean) +
                   (lobe.empty_rad() > 0 ? kTwinEmpty * mean : 0.0);
  return averages;
}

}  // namespace lightkiln
