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

// Where the texel (x, y) of OpenGL's face, row 0 at t = 0 (which is the picture's top), stands in
// our strip.
struct StripTexel {
  int x, y;
};
StripTexel strip_texel(int face, int x, int y, int size) {
  static const std::array<Vec3d, 3> axes = sh_target_axes(ShTarget::ext_lights_image_based);
  const FaceAxes& slot = kFaces[face];
  const Vec3d theirs = slot.major + slot.along_s * ((2.0 * x + 1) / size - 1) +
                       slot.along_t * ((2.0 * y + 1) / size - 1);
  // theirs = rows * ours, and the rows are orthonormal.
  const Vec3d ours = axes[0] * theirs.x + axes[1] * theirs.y + axes[2] * theirs.z;
  int from = 0;
  double s = 0, t = 0;
  cube_coordinates(ours, &from, &s, &t);
  return {std::min(static_cast<int>(s * size), size - 1),
          from * size + std::min(static_cast<int>(t * size), size - 1)};
}

// visit(texel of OpenGL's strip, texel of ours) for every texel.
template <typename Visit>
void for_each_pair(const Image& strip, const Visit& visit) {
  const int size = strip.width;
  assert(strip.height == 6 * size);
  for (int face = 0; face < 6; ++face) {
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        visit(StripTexel{x, face * size + y}, strip_texel(face, x, y, size));
      }
    }
  }
}

}  // namespace

Image strip_to_opengl(const Image& strip) {
  Image theirs(strip.width, strip.height, strip.channels);
  for_each_pair(strip, [&](const StripTexel& their, const StripTexel& our) {
    std::copy_n(strip.at(our.x, our.y), strip.channels, theirs.at(their.x, their.y));
  });
  return theirs;
}

Image strip_from_opengl(const Image& strip) {
  Image ours(strip.width, strip.height, strip.channels);
  for_each_pair(strip, [&](const StripTexel& their, const StripTexel& our) {
    std::copy_n(strip.at(their.x, their.y), strip.channels, ours.at(our.x, our.y));
  });
  return ours;
}

Image lookup_face(const Image& strip, int face) {
  const int size = strip.width;
  assert(strip.height == 6 * size);
  Image image(size, size, strip.channels);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const StripTexel from = strip_texel(face, x, size - 1 - y, size);
      std::copy_n(strip.at(from.x, from.y), strip.channels, image.at(x, y));
    }
  }
  return image;
}

}  // namespace lightkiln
