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

// Where a whole face of OpenGL's stands in our strip: a turn or a flip, told by three corners.
struct FaceMove {
  StripTexel origin;     // of (0, 0)
  int right_x, right_y;  // a step in x
  int down_x, down_y;    // a step in y

  FaceMove(int face, int size) : origin(strip_texel(face, 0, 0, size)) {
    const int last = std::max(1, size - 1);
    const StripTexel right = strip_texel(face, size - 1, 0, size);
    const StripTexel down = strip_texel(face, 0, size - 1, size);
    right_x = (right.x - origin.x) / last, right_y = (right.y - origin.y) / last;
    down_x = (down.x - origin.x) / last, down_y = (down.y - origin.y) / last;
  }
  StripTexel at(int x, int y) const {
    return {origin.x + x * right_x + y * down_x, origin.y + x * right_y + y * down_y};
  }
};

// visit(texel of OpenGL's strip, texel of ours) for every texel.
template <typename Visit>
void for_each_pair(const Image& strip, const Visit& visit) {
  const int size = strip.width;
  assert(strip.height == 6 * size);
  for (int face = 0; face < 6; ++face) {
    const FaceMove move(face, size);
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) visit(StripTexel{x, face * size + y}, move.at(x, y));
    }
  }
}

}  // namespace

const char* face_orientation_name(FaceOrientation orientation) {
  return orientation == FaceOrientation::opengl ? "opengl" : "openexr";
}

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
  const FaceMove move(face, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const StripTexel from = move.at(x, size - 1 - y);
      std::copy_n(strip.at(from.x, from.y), strip.channels, image.at(x, y));
    }
  }
  return image;
}

}  // namespace lightkiln
