#pragma once

// Small maps that tests paint themselves.

#include <algorithm>
#include <cmath>

#include "core/environment/environment.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln::test {

inline Environment environment_of(const Image& image) {
  DecodedImage decoded;
  decoded.image = image;
  return make_environment(decoded);
}

inline Image map_of(int height, const Vec3& value) {
  Image map(2 * height, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < map.width; ++x) std::copy_n(&value.x, 3, map.at(x, y));
  }
  return map;
}

// Radiance of a disk put over the map: texels hold the share of them that it covers, told by
// 16 x 16 points each.
inline void paint_disk(Image* map, const Vec3d& direction, double radius_rad,
                       const Vec3& radiance) {
  constexpr int kCuts = 16;
  const Vec3d centre = normalize(direction);
  const double reach = std::cos(radius_rad), around = std::cos(radius_rad + 2 * kPi / map->height);
  for (int y = 0; y < map->height; ++y) {
    for (int x = 0; x < map->width; ++x) {
      const Vec3d middle = latlong_direction((x + 0.5) / map->width, (y + 0.5) / map->height);
      if (dot(middle, centre) < around) continue;
      int covered = 0;
      for (int i = 0; i < kCuts * kCuts; ++i) {
        const double u = (x + (i % kCuts + 0.5) / kCuts) / map->width;
        const double v = (y + (i / kCuts + 0.5) / kCuts) / map->height;
        covered += dot(latlong_direction(u, v), centre) >= reach ? 1 : 0;
      }
      const float share = static_cast<float>(covered) / (kCuts * kCuts);
      float* p = map->at(x, y);
      p[0] += share * (radiance.x - p[0]);
      p[1] += share * (radiance.y - p[1]);
      p[2] += share * (radiance.z - p[2]);
    }
  }
}

// The integral of radiance over the sphere, texel by texel.
inline Vec3d energy_of(const Image& map) {
  Vec3d sum;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      sum += to_double(map.rgb(x, y)) * latlong_texel_solid_angle(y, map.width, map.height);
    }
  }
  return sum;
}

}  // namespace lightkiln::test
