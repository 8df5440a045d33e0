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
  // The image must outlive this object; its pixels may change, its size not.
  explicit LatlongGrid(const Image& image) : image_(image) {
    for (int x = 0; x < image.width; ++x) {
      columns_.push_back(latlong_direction((x + 0.5) / image.width, 0.5));
    }
    for (int y = 0; y < image.height; ++y) {
      const Vec3d d = latlong_direction(0, (y + 0.5) / image.height);
      const Vec3d m = latlong_texel_moment(0, y, image.width, image.height);
      rows_.push_back({std::hypot(d.x, d.z), d.y, std::hypot(m.x, m.z), m.y,
                       latlong_texel_solid_angle(y, image.width, image.height)});
    }
  }

  int width() const { return image_.width; }
  int height() const { return image_.height; }
  size_t index(Texel t) const {
    return static_cast<size_t>(t.y) * static_cast<size_t>(image_.width) + static_cast<size_t>(t.x);
  }
  double luminance_at(Texel t) const { return luminance(to_double(image_.rgb(t.x, t.y))); }
  Vec3d radiance(Texel t) const { return to_double(image_.rgb(t.x, t.y)); }
  // Of the texel's centre.
  Vec3d direction(Texel t) const {
    const Row& row = rows_[static_cast<size_t>(t.y)];
    return along(t.x, row.sine, row.cosine);
  }
  double solid_angle(Texel t) const { return rows_[static_cast<size_t>(t.y)].solid_angle; }
  // The integral of direction over the texel.
  Vec3d moment(Texel t) const {
    const Row& row = rows_[static_cast<size_t>(t.y)];
    return along(t.x, row.outward, row.upward);
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
  struct Row {
    double sine, cosine;     // of the colatitude of texel centres
    double outward, upward;  // parts of a texel's moment
    double solid_angle;
  };
  Vec3d along(int x, double outward, double upward) const {
    const Vec3d& column = columns_[static_cast<size_t>(x)];
    return {column.x * outward, upward, column.z * outward};
  }

  const Image& image_;
  std::vector<Vec3d> columns_;  // on the horizon
  std::vector<Row> rows_;
};

// Between unit vectors, in radians; exact for small angles too.
inline double angle_between(const Vec3d& a, const Vec3d& b) {
  return 2 * std::asin(std::min(1.0, length(a - b) / 2));
}

}  // namespace lightkiln
