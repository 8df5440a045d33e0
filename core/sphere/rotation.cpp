#include "core/sphere/rotation.h"

#include <cmath>

namespace lightkiln {

bool Rotation::is_identity() const {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (rows[i][j] != (i == j ? 1 : 0)) return false;
    }
  }
  return true;
}

Rotation yaw_rotation(double degrees) {
  // Quarter turns are split off first, so that they have no rounding.
  const double turn = std::remainder(degrees, 360.0);
  const double quarters = std::nearbyint(turn / 90);
  const double rest = (turn - 90 * quarters) * kPi / 180;
  const double c0 = std::cos(rest), s0 = std::sin(rest);
  const int quarter = (static_cast<int>(quarters) + 4) % 4;
  const double c = quarter == 0 ? c0 : quarter == 1 ? -s0 : quarter == 2 ? -c0 : s0;
  const double s = quarter == 0 ? s0 : quarter == 1 ? c0 : quarter == 2 ? -s0 : -c0;
  return {{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}};
}

// d' = d + 2 w (v x d) + 2 v x (v x d) for a unit quaternion (v, w), written as a matrix
// (K. Shoemake, "Animating rotation with quaternion curves", 1985).
Rotation quaternion_rotation(double x, double y, double z, double w) {
  const double scale = 2 / (x * x + y * y + z * z + w * w);
  return {{{1 - scale * (y * y + z * z), scale * (x * y - z * w), scale * (x * z + y * w)},
           {scale * (x * y + z * w), 1 - scale * (x * x + z * z), scale * (y * z - x * w)},
           {scale * (x * z - y * w), scale * (y * z + x * w), 1 - scale * (x * x + y * y)}}};
}

}  // namespace lightkiln
