#pragma once

// Proper rotations of directions.

#include "core/base/math.h"

namespace lightkiln {

// Turns a direction d into R d. An environment turned by R has at R d what stood at d, so that its
// radiance is g(d) = f(R^-1 d).
struct Rotation {
  double rows[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

  Vec3d apply(const Vec3d& d) const {
    return {rows[0][0] * d.x + rows[0][1] * d.y + rows[0][2] * d.z,
            rows[1][0] * d.x + rows[1][1] * d.y + rows[1][2] * d.z,
            rows[2][0] * d.x + rows[2][1] * d.y + rows[2][2] * d.z};
  }
  // R^-1 d.
  Vec3d undo(const Vec3d& d) const {
    return {rows[0][0] * d.x + rows[1][0] * d.y + rows[2][0] * d.z,
            rows[0][1] * d.x + rows[1][1] * d.y + rows[2][1] * d.z,
            rows[0][2] * d.x + rows[1][2] * d.y + rows[2][2] * d.z};
  }
  // Exactly the identity: such a turn is left out, and changes no byte.
  bool is_identity() const;
};

// Right-handed about +Y: counter-clockwise seen from above; 90 degrees turns +Z into +X. Multiples
// of 90 degrees are exact.
Rotation yaw_rotation(double degrees);

// (x, y, z, w) with the real part last, as in glTF; any length above zero, which is divided out.
// q and -q are the same rotation.
Rotation quaternion_rotation(double x, double y, double z, double w);

}  // namespace lightkiln
