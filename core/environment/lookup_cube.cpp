// Sources: Khronos Group, OpenGL 4.6 core profile, table 8.19 (selection of cube map images);
// Khronos Group, EXT_lights_image_based, README ("each saved image must be flipped about its
// vertical axis to correspond with the way glTF references texture space"). Read as an exchange of
// left and right that sentence would tear the cube apart at its edges; Babylon.js 9 reads it as
// what glTF's texture space does to OpenGL's, an exchange of top and bottom.

#include "core/environment/lookup_cube.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "core/sphere/direction_map.h"
#include "core/sphere/harmonic_exports.h"

namespace lightkiln {

namespace {

// The major axis of a face and the directions in which s and t grow, of OpenGL's table.
struct FaceAxes {
  Vec3d major, along_s, along_t;
};
constexpr FaceAxes kFaces[6] = {
    {{1, 0, 0}, {0, 0, -1}, {0, -1, 0}}, {{-1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
    {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}},   {{0, -1, 0}, {1, 0, 0}, {0, 0, -1}},
    {{0, 0, 1}, {1, 0, 0}, {0, -1, 0}},  {{0, 0, -1}, {-1, 0, 0}, {0, -1, 0}},
};

}  // namespace

Image lookup_face(const Image& cube, int face) {
  const int size = cube.width;
  assert(cube.height == 6 * size);
  const std::array<Vec3d, 3> axes = sh_target_axes(ShTarget::ext_lights_image_based);
  const FaceAxes& slot = kFaces[face];
  Image image(size, size, cube.channels);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Vec3d theirs = slot.major + slot.along_s * ((2.0 * x + 1) / size - 1) +
                           slot.along_t * (1 - (2.0 * y + 1) / size);
      // theirs = rows * ours, and the rows are orthonormal.
      const Vec3d ours = axes[0] * theirs.x + axes[1] * theirs.y + axes[2] * theirs.z;
      int from = 0;
      double s = 0, t = 0;
      cube_coordinates(ours, &from, &s, &t);
      const int column = std::min(static_cast<int>(s * size), size - 1);
      const int row = std::min(static_cast<int>(t * size), size - 1);
      std::copy_n(cube.at(column, from * size + row), cube.channels, image.at(x, y));
    }
  }
  return image;
}

}  // namespace lightkiln
