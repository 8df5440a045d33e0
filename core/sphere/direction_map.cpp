// Sources: OpenEXR, "Technical Introduction to OpenEXR", section "Environment Maps", and the
// `envmap` standard attribute, which fix the corner orientation of every cube face.

#include "core/sphere/direction_map.h"

#include <algorithm>

#include "core/base/pinned_math.h"

namespace lightkiln {

namespace {

// A face as stored: the direction of texture coordinates (s, t) in [0, 1]^2 is
//   normal + (2 s - 1) right + (2 t - 1) down,
// which is the standard's table of corner pixels written as three axes.
struct FaceAxes {
  Vec3d normal, right, down;
};
constexpr std::array<FaceAxes, 6> kFaces = {{
    {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},    // +X
    {{-1, 0, 0}, {0, 0, -1}, {0, -1, 0}},  // -X
    {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},    // +Y
    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}},    // -Y
    {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},   // +Z
    {{0, 0, -1}, {1, 0, 0}, {0, -1, 0}},   // -Z
}};

}  // namespace

Vec3d latlong_direction(double u, double v) {
  // Longitude pi at the left edge, -pi at the right one; latitude pi/2 at the top.
  const double longitude = kPi * (1 - 2 * u);
  const double colatitude = kPi * v;
  const SinCos down = pinned_sin_cos(colatitude), around = pinned_sin_cos(longitude);
  return {down.sin * around.sin, down.cos, down.sin * around.cos};
}

void latlong_coordinates(const Vec3d& direction, double* u, double* v) {
  const double horizontal = std::sqrt(direction.x * direction.x + direction.z * direction.z);
  const double longitude = pinned_atan2(direction.x, direction.z);
  const double wrapped = 0.5 - longitude / (2 * kPi);
  // Longitude -pi is the same meridian as pi, which is u = 0.
  *u = wrapped < 1 ? std::max(wrapped, 0.0) : 0.0;
  // atan2 keeps full accuracy at the poles, where asin(y) loses half the digits.
  *v = std::clamp(pinned_atan2(horizontal, direction.y) / kPi, 0.0, 1.0);
}

Vec3d cube_direction(int face, double s, double t) {
  const FaceAxes& axes = kFaces[static_cast<size_t>(face)];
  return normalize(axes.normal + axes.right * (2 * s - 1) + axes.down * (2 * t - 1));
}

void cube_coordinates(const Vec3d& direction, int* face, double* s, double* t) {
  const double x = std::abs(direction.x), y = std::abs(direction.y), z = std::abs(direction.z);
  if (x >= y && x >= z) {
    *face = direction.x >= 0 ? 0 : 1;
  } else if (y >= z) {
    *face = direction.y >= 0 ? 2 : 3;
  } else {
    *face = direction.z >= 0 ? 4 : 5;
  }
  const FaceAxes& axes = kFaces[static_cast<size_t>(*face)];
  const double depth = dot(direction, axes.normal);
  *s = std::clamp(0.5 + 0.5 * dot(direction, axes.right) / depth, 0.0, 1.0);
  *t = std::clamp(0.5 + 0.5 * dot(direction, axes.down) / depth, 0.0, 1.0);
}

Vec3d cube_texel_direction(int face, int x, int y, int size) {
  return cube_direction(face, (x + 0.5) / size, (y + 0.5) / size);
}

}  // namespace lightkiln
