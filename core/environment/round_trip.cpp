#include "core/environment/round_trip.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/parallel.h"
#include "core/environment/layout_convert.h"
#include "core/environment/layout_sample.h"
#include "core/sphere/radial_map.h"
#include "core/sphere/texel_density.h"

namespace lightkiln {

namespace {

constexpr double kLookedUpTexels = 1 << 20;
constexpr double kBright = 64;  // times the mean

struct Sums {
  double omega = 0, covered = 0;  // steradians
  double light = 0, light_square = 0, difference_square = 0;
  double largest = 0;

  void add(const Sums& other) {
    omega += other.omega;
    covered += other.covered;
    light += other.light;
    light_square += other.light_square;
    difference_square += other.difference_square;
    largest = std::max(largest, other.largest);
  }
};

// True of the texels near the rim of a round layout. A close-up ball's density grows there as
// 1 / sqrt(1 - radius), faster than a texel's mean density follows, and the rim cuts texels.
bool near_rim(const MapLayout& layout, int x, int y) {
  constexpr double kRings = 8;
  if (!is_radial(layout.kind)) return false;
  const double half = 0.5 * layout.width;
  return std::hypot(x + 0.5 - half, y + 0.5 - half) > half - kRings;
}

// Solid angle of the part of a texel that lies on the sphere.
double omega_of(const MapLayout& layout, const TexelDensity& density, int x, int y) {
  if (!texel_has_direction(layout, x, y)) return 0;
  if (near_rim(layout, x, y)) return texel_solid_angle(layout, x, y);
  double omega = density(x, y);
  if (layout.convention == TexelConvention::openexr) {
    const int rows = is_cube(layout.kind) ? cube_face_size(layout) : layout.height;
    if (x == 0 || x == layout.width - 1) omega *= 0.5;
    if (y % rows == 0 || y % rows == rows - 1) omega *= 0.5;
  }
  return omega;
}

double mean_luminance(const MapLayout& layout, const Image& image) {
  const TexelDensity density(layout);
  double light = 0, omega = 0;
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      const double weight = omega_of(layout, density, x, y);
      if (weight == 0) continue;
      light += weight * luminance(to_double(image.rgb(x, y)));
      omega += weight;
    }
  }
  return omega > 0 ? light / omega : 0;
}

double square(const Vec3d& v) {
  return dot(v, v) / 3;
}

}  // namespace

RoundTrip measure_round_trip(const MapLayout& from, const Image& source, const MapLayout& to,
                             const Image& converted, const Rotation& rotation, int threads,
                             Progress& progress) {
  RoundTrip result;
  const double mean = mean_luminance(from, source);
  result.mean_before = mean;
  if (moves_texels(from, to, rotation)) {
    result.mean_after = mean;
    return result;
  }
  const TexelDensity density(from);
  const double texels = double(from.width) * from.height;
  const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(texels / kLookedUpTexels))));
  std::vector<Sums> rows(static_cast<size_t>(from.height));
  parallel_blocks(rows.size(), 16, threads, progress, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      Sums& sums = rows[row];
      for (int x = 0; x < from.width; ++x) {
        const Vec3d value = to_double(source.rgb(x, y));
        const bool bright = luminance(value) > kBright * mean;
        const bool chosen = y % step == step / 2 && x % step == step / 2;
        if (!bright && !chosen) continue;
        const double omega = omega_of(from, density, x, y) * (bright ? 1 : step * step);
        if (omega == 0) continue;
        sums.omega += omega;
        const Vec3d direction = layout_direction(from, x + 0.5, y + 0.5).value();
        const std::optional<MapPlace> place = layout_place(to, rotation.apply(direction));
        if (!place) continue;
        const Vec3d back = smooth_radiance(to, converted, *place);
        sums.covered += omega;
        sums.light += omega * luminance(value);
        sums.light_square += omega * square(value);
        sums.difference_square += omega * square(back - value);
        sums.largest = std::max({sums.largest, value.x, value.y, value.z});
      }
    }
  });
  Sums all;
  for (const Sums& row : rows) all.add(row);
  if (all.covered <= 0) {
    result.not_covered_share = 1;
    return result;
  }
  // Every closed form that exists; a source and a target that both leave something out are counted
  // by texels.
  const double source_part = covered_solid_angle(from), target_part = covered_solid_angle(to);
  result.not_covered_share = target_part > 4 * kPi * (1 - 1e-12) ? 0
                             : source_part > 4 * kPi * (1 - 1e-12)
                                 ? 1 - target_part / (4 * kPi)
                                 : (1 - all.covered / all.omega) * source_part / (4 * kPi);
  result.mean_before = all.light / all.covered;
  result.mean_after = mean_luminance(to, converted);
  const double rms = std::sqrt(all.difference_square / all.covered);
  const double light_rms = std::sqrt(all.light_square / all.covered);
  result.relative_rms = light_rms > 0 ? rms / light_rms : 0;
  if (rms > 0) result.psnr_db = 20 * std::log10(all.largest / rms);
  return result;
}

}  // namespace lightkiln
