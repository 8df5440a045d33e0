#pragma once

// A lat-long map as a graph of texels and as a measure over directions.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/image/image.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

struct Texel {
  int x = 0, y = 0;
};

// The map as a graph and as a measure.
class LatlongGrid {
 public:
  explicit LatlongGrid(const Image& image) : image_(image) {}

  int width() const { return image_.width; }
  int height() const { return image_.height; }
  size_t index(Texel t) const {
    return static_cast<size_t>(t.y) * static_cast<size_t>(image_.width) + static_cast<size_t>(t.x);
  }
  double luminance_at(Texel t) const { return luminance(to_double(image_.rgb(t.x, t.y))); }
  Vec3d radiance(Texel t) const { return to_double(image_.rgb(t.x, t.y)); }
  Vec3d direction(Texel t) const {
    return latlong_direction((t.x + 0.5) / image_.width, (t.y + 0.5) / image_.height);
  }
  double solid_angle(Texel t) const {
    return latlong_texel_solid_angle(t.y, image_.width, image_.height);
  }
  Vec3d moment(Texel t) const {
    return latlong_texel_moment(t.x, t.y, image_.width, image_.height);
  }
  // Longitudes wrap; past a pole lies the same row half a turn away.
  std::array<Texel, 8> neighbours(Texel t) const {
    std::array<Texel, 8> result;
    size_t count = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (dx == 0 && dy == 0) continue;
        int x = t.x + dx + image_.width, y = t.y + dy;
        if (y < 0 || y >= image_.height) {
          y = t.y;
          x += image_.width / 2;
        }
        result[count++] = {x % image_.width, y};
      }
    }
    return result;
  }

 private:
  const Image& image_;
};

// Between unit vectors, in radians; exact for small angles too.
inline double angle_between(const Vec3d& a, const Vec3d& b) {
  return 2 * std::asin(std::min(1.0, length(a - b) / 2));
}

}  // namespace lightkiln
