#pragma once

// What a convolution ought to give, by the plain sum over every texel in double precision: too slow
// to bake with, and therefore what a few texels of each bake are held against.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/parallel.h"
#include "core/environment/environment.h"

namespace lightkiln {

namespace brute_force {

inline constexpr int kMostCells = 64;

// The lobe's integral over the part of the sphere between two longitudes and two colatitudes, cut
// into cells x cells, each by two Gauss points a side. Over a cell h wide a lobe of width w errs by
// about (h / w)^4 / 4320 of its largest fourth derivative: 1e-5 at a cell of an eighth of w.
template <typename Lobe>
double integrate_lobe(const Lobe& lobe, const Vec3d& axis, double longitude_rad,
                      double colatitude_rad, double width_rad, double height_rad, int cells) {
  const double node = 0.5 / std::sqrt(3.0);
  const double width = width_rad / cells, height = height_rad / cells;
  std::array<double, 2 * kMostCells> across;  // the axis' share along each meridian of points
  for (int i = 0; i < 2 * cells; ++i) {
    const double phi = longitude_rad + (i / 2 + 0.5 + (i % 2 ? node : -node)) * width;
    across[static_cast<size_t>(i)] = axis.x * std::sin(phi) + axis.z * std::cos(phi);
  }
  double sum = 0;
  for (int j = 0; j < 2 * cells; ++j) {
    const double theta = colatitude_rad + (j / 2 + 0.5 + (j % 2 ? node : -node)) * height;
    const double ring = std::sin(theta), y = std::cos(theta);
    for (int i = 0; i < 2 * cells; ++i) {
      const double cosine = axis.y * y + ring * across[static_cast<size_t>(i)];
      sum += ring * lobe(std::clamp(cosine, -1.0, 1.0));
    }
  }
  return sum * width * height / 4;
}

// A row of the map, colour by colour.
struct Row {
  double colatitude_rad = 0;  // of its middle
  double omega = 0;           // of a texel
  std::vector<double> red, green, blue;
  std::vector<uint8_t> bright;  // 1 where a texel's luminance lies above 20 times the mean
};
Row read_row(const Environment& environment, int y);

// Longitudes of the columns' middles.
struct Columns {
  explicit Columns(int width);
  std::vector<double> sine, cosine;
};
// Cosines of the angles between `axis` and the middles of a row's texels.
void fill_cosines(const Columns& columns, const Vec3d& axis, double colatitude_rad,
                  std::span<double> cosines);
// The columns whose texel's middle cannot stand for it: on the lobe's horizon (cosines below
// `side`), about its axis (above `near`), and where it is bright.
void find_exceptions(const Row& row, std::span<const double> cosines, double side, double near,
                     std::vector<size_t>* columns);
// The sum of the row's texels times `weights`, in an order of its own that any machine keeps.
Vec3d weighted_sum(const Row& row, std::span<const double> weights);

}  // namespace brute_force

// Over which distances a lobe changes: about its axis, and away from it.
struct LobeWidths {
  double core_rad = 0;
  double elsewhere_rad = 1e9;
};

// The lobe's averages of the map about each of `axes`. Where a texel is smaller than a fiftieth of
// the distance over which the lobe changes, its middle stands for it; elsewhere, on the lobe's
// horizon and for bright texels the lobe is integrated. Lobe: operator()(cosine) and the same side
// by side, fill(cosines, values); integrating to 1 over the sphere. The same bits for any number of
// threads.
template <typename Lobe>
std::vector<Vec3d> lobe_averages(const Environment& environment, const Lobe& lobe,
                                 const LobeWidths& widths, std::span<const Vec3d> axes, int threads,
                                 Progress& progress) {
  if (axes.empty()) return {};
  constexpr double kKinkCell = 0.002;
  constexpr size_t kRows = 16;  // summed together
  const Image& map = environment.radiance;
  const double step = 2 * kPi / map.width, row_step = kPi / map.height;
  const double side = std::max(step, row_step);
  const double reach = 50 * side < widths.elsewhere_rad ? 50 * side - widths.core_rad : kPi;
  const double near = reach > 0 ? std::cos(std::min(kPi, reach)) : 2;
  const auto cells_of = [&](double cosine, bool bright) {
    // On the lobe's horizon, a kink crosses the texel.
    if (std::abs(cosine) < side) return bright ? double(brute_force::kMostCells) : side / kKinkCell;
    return 8 * side /
           std::min(widths.core_rad + std::max(0.0, std::acos(cosine) - side),
                    widths.elsewhere_rad);
  };
  const brute_force::Columns columns(map.width);
  const size_t height = static_cast<size_t>(map.height), blocks = (height + kRows - 1) / kRows;
  std::vector<Vec3d> sums(blocks * axes.size());
  parallel_blocks(
      height, kRows, threads, progress,
      [&](size_t begin, size_t end) {
        std::vector<double> cosines(columns.sine.size()), values(cosines.size());
        std::vector<size_t> exceptions;
        for (size_t y = begin; y < end; ++y) {
          const brute_force::Row row = brute_force::read_row(environment, static_cast<int>(y));
          for (size_t a = 0; a < axes.size(); ++a) {
            brute_force::fill_cosines(columns, axes[a], row.colatitude_rad, cosines);
            lobe.fill(cosines, values);
            brute_force::find_exceptions(row, cosines, side, near, &exceptions);
            for (const size_t x : exceptions) {
              const int cells =
                  std::clamp(static_cast<int>(std::ceil(cells_of(cosines[x], row.bright[x]))), 1,
                             brute_force::kMostCells);
              values[x] = brute_force::integrate_lobe(
                              lobe, axes[a], kPi - (static_cast<double>(x) + 1) * step,
                              static_cast<double>(y) * row_step, step, row_step, cells) /
                          row.omega;
            }
            sums[begin / kRows * axes.size() + a] +=
                brute_force::weighted_sum(row, values) * row.omega;
          }
        }
      },
      1, 1);
  std::vector<Vec3d> averages(axes.size());
  for (size_t i = 0; i < sums.size(); ++i) averages[i % axes.size()] += sums[i];
  return averages;
}

// A coefficient of the map in the frame of LatlongSpectrum: polar axis +Y, azimuth the longitude; m
// < 0 is the sine of |m|.
Vec3d projected_coefficient(const Environment& environment, int l, int m);

// The mean of the map, constant on each texel, over a texel of a cube: `meridians` of every column
// of the map, each cut by the four planes of the texel's sides and summed row by row. Its error
// falls as their square: to about 1e-5 of what the columns differ by at 64.
Vec3d texel_average(const Environment& environment, int face, int x, int y, int size,
                    int meridians = 64);

}  // namespace lightkiln
