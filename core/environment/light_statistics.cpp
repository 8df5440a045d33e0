#include "core/environment/light_statistics.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

// Texels this many times brighter than the mean are candidates for correction.
constexpr double kBrightFactor = 20;

struct Moments {
  Vec3d squares;  // integral of radiance squared
  Vec3d energy;   // integral of radiance
  double spread(double mean_luminance) const {
    double largest = 0;
    for (int c = 0; c < 3; ++c) {
      const double mean = energy[c] / (4 * kPi);
      largest = std::max(largest, squares[c] / (4 * kPi) - mean * mean);
    }
    return std::sqrt(std::max(largest, 0.0)) / mean_luminance;
  }
};

struct Candidate {
  int x, y;
  double power;  // luminance squared times solid angle: its share of the squared norm
};

}  // namespace

LightStatistics measure_light(const Environment& environment) {
  const Image& map = environment.radiance;
  LightStatistics light;
  light.map_height = map.height;
  light.mean = environment.mean;
  light.mean_luminance = luminance(environment.mean);
  light.lowest = light.highest = map.rgb(0, 0);
  Moments all;
  std::vector<Candidate> candidates;
  const double threshold = kBrightFactor * light.mean_luminance;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    Vec3d squares, energy;
    for (int x = 0; x < map.width; ++x) {
      const Vec3 value = map.rgb(x, y);
      const Vec3d exact = to_double(value);
      squares += exact * exact;
      energy += exact;
      for (int c = 0; c < 3; ++c) {
        light.lowest[c] = std::min(light.lowest[c], value[c]);
        light.highest[c] = std::max(light.highest[c], value[c]);
      }
      const double bright = luminance(exact);
      if (bright > threshold) candidates.push_back({x, y, bright * bright * omega});
    }
    all.squares += squares * omega;
    all.energy += energy * omega;
  }
  if (environment.constant || !(light.mean_luminance > 0)) return light;
  light.spread = all.spread(light.mean_luminance);

  const size_t count = std::min<size_t>(candidates.size(), kMaxBrightTexels);
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<long>(count),
                    candidates.end(), [](const Candidate& a, const Candidate& b) {
                      return a.power != b.power ? a.power > b.power
                                                : std::pair(a.y, a.x) < std::pair(b.y, b.x);
                    });
  Moments rest = all;
  const double total = luminance(all.energy);
  for (size_t i = 0; i < count; ++i) {
    const Candidate& c = candidates[i];
    // Enough when the rest is as tame as an ordinary sky, or one texel no longer matters.
    const double spread = rest.spread(light.mean_luminance) * light.mean_luminance;
    if (spread < 2 * light.mean_luminance || c.power < 1e-3 * spread * spread * 4 * kPi) break;
    const double omega = latlong_texel_solid_angle(c.y, map.width, map.height);
    const Vec3d value = to_double(map.rgb(c.x, c.y));
    light.bright.push_back({latlong_direction((c.x + 0.5) / map.width, (c.y + 0.5) / map.height),
                            value * omega, kPi / map.height});
    light.bright_share += luminance(value) * omega / total;
    rest.squares -= value * value * omega;
    rest.energy -= value * omega;
  }
  light.rest_spread = light.bright.empty() ? light.spread : rest.spread(light.mean_luminance);
  return light;
}

}  // namespace lightkiln
