#include "core/environment/turned_cube.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/environment/brute_force.h"
#include "core/environment/layout_convert.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

double brightest(const Vec3& value) {
  return std::max({double(value.x), double(value.y), double(value.z)});
}

// Root mean square over the sphere of max(1, brightest channel / mean), cut at kTurnedBright.
double clipped_spread(const Environment& environment) {
  const Image& map = environment.radiance;
  const double mean = luminance(environment.mean);
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    double row = 0;
    for (int x = 0; x < map.width; ++x) {
      const double value = std::clamp(brightest(map.rgb(x, y)) / mean, 1.0, kTurnedBright);
      row += value * value;
    }
    sum += row * latlong_texel_solid_angle(y, map.width, map.height);
  }
  return std::sqrt(sum / (4 * kPi));
}

struct Texel {
  int x, line;  // of the strip
};

// Texels of the cube that a bright texel of the map may reach into: its grid of points half a
// texel apart, and around each one a texel's width to all sides.
std::vector<Texel> find_bright(const Environment& environment, int face_size) {
  const Image& map = environment.radiance;
  const double limit = kTurnedBright * luminance(environment.mean);
  const double width = 2.0 / face_size;
  const int across = 1 + static_cast<int>(std::ceil(2 * kPi / map.width / (0.5 * width)));
  const MapLayout strip = make_layout(LayoutKind::cube_strip, face_size);
  std::vector<char> marked(6 * static_cast<size_t>(face_size) * static_cast<size_t>(face_size));
  const auto mark = [&](const Vec3d& direction) {
    const MapPlace place = layout_place(strip, environment.pending.apply(direction)).value();
    const int x = std::clamp(static_cast<int>(place.x), 0, face_size - 1);
    const int line = std::clamp(static_cast<int>(place.y), 0, 6 * face_size - 1);
    marked[static_cast<size_t>(line) * static_cast<size_t>(face_size) + static_cast<size_t>(x)] = 1;
  };
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (brightest(map.rgb(x, y)) <= limit) continue;
      for (int j = 0; j <= across; ++j) {
        for (int i = 0; i <= across; ++i) {
          const Vec3d d = latlong_direction((x + double(i) / across) / map.width,
                                            (y + double(j) / across) / map.height);
          const Vec3d side = std::abs(d.y) < 0.9 ? normalize(cross(Vec3d{0, 1, 0}, d))
                                                 : normalize(cross(Vec3d{1, 0, 0}, d));
          const Vec3d up = cross(d, side);
          for (const int a : {-1, 0, 1}) {
            for (const int b : {-1, 0, 1})
              mark(normalize(d + side * (a * width) + up * (b * width)));
          }
        }
      }
    }
  }
  std::vector<Texel> texels;
  for (size_t i = 0; i < marked.size(); ++i) {
    if (!marked[i]) continue;
    texels.push_back({static_cast<int>(i % static_cast<size_t>(face_size)),
                      static_cast<int>(i / static_cast<size_t>(face_size))});
  }
  return texels;
}

// The error of m meridians a column falls as 1 / m^2: what four times as many change is nearly all
// that of the fewer, fifteen times that of the more.
Vec3d converged_average(const Environment& environment, const Texel& texel, int size,
                        double error) {
  constexpr int kMostMeridians = 1 << 13;
  const auto average = [&](int meridians) {
    return texel_average(environment, texel.line / size, texel.x, texel.line % size, size,
                         meridians);
  };
  Vec3d coarse = average(8);
  for (int meridians = 32;; meridians *= 4) {
    const Vec3d fine = average(meridians);
    const Vec3d change = fine - coarse;
    const double most = std::max({std::abs(change.x), std::abs(change.y), std::abs(change.z)});
    if (most <= 15 * error || 4 * meridians > kMostMeridians) return fine;
    coarse = fine;
  }
}

}  // namespace

TurnedCubePlan plan_turned_cube(const Environment& environment, double error) {
  constexpr double kFinest = 1e-6, kCoarsest = 0.05, kConverted = 0.8, kBright = 0.1;
  const double spread = clipped_spread(environment);
  TurnedCubePlan plan;
  plan.conversion_error = std::clamp(kConverted * error / spread, kFinest, kCoarsest);
  plan.bright_error = kBright * error;
  plan.error_bound = plan.conversion_error * spread + plan.bright_error;
  return plan;
}

Image turn_to_cube(const Environment& environment, const TurnedCubePlan& plan, int face_size,
                   int threads, Progress& progress) {
  const ConversionSource source(make_layout(LayoutKind::latlong, environment.radiance.width),
                                environment.radiance);
  Image cube =
      convert_layout(source, make_layout(LayoutKind::cube_strip, face_size), environment.pending,
                     MapFilter::area, plan.conversion_error, threads, progress);
  const std::vector<Texel> texels = find_bright(environment, face_size);
  if (texels.empty()) return cube;
  // Few texels may each err by more.
  const double share = static_cast<double>(texels.size()) / (6.0 * face_size * face_size);
  const double error =
      plan.bright_error * luminance(environment.mean) / std::sqrt(std::min(1.0, share));
  parallel_blocks(texels.size(), 8, threads, progress, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3 value = to_float(converged_average(environment, texels[i], face_size, error));
      std::copy_n(&value.x, 3, cube.at(texels[i].x, texels[i].line));
    }
  });
  return cube;
}

}  // namespace lightkiln
