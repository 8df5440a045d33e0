#include "core/environment/lookup_cube.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/sphere/direction_map.h"

namespace lightkiln {
namespace {

Image numbered(int size) {
  Image strip(size, 6 * size, 3);
  for (size_t i = 0; i < strip.pixels.size(); ++i) strip.pixels[i] = float(i);
  return strip;
}

// Khronos Group, OpenGL 4.6 core profile, table 8.19, for the face +Z: sc = rx, tc = -ry, ma = rz;
// s = (sc / |ma| + 1) / 2, t = (tc / |ma| + 1) / 2. The world is (-x, y, z).
TEST(LookupCube, TheFaceAheadIsThatOfTheTable) {
  constexpr int kSize = 5, kAhead = 4;
  const Image ours = numbered(kSize), theirs = strip_to_opengl(ours);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const Vec3d d = cube_texel_direction(kAhead, x, y, kSize);
      const Vec3d r = {-d.x, d.y, d.z};
      const double s = (r.x / std::abs(r.z) + 1) / 2, t = (-r.y / std::abs(r.z) + 1) / 2;
      EXPECT_EQ(theirs.rgb(int(s * kSize), kAhead * kSize + int(t * kSize)),
                ours.rgb(x, kAhead * kSize + y));
    }
  }
}

TEST(LookupCube, MovesEveryTexelOfAnySizeAndBack) {
  for (const int size : {1, 2, 3, 8, 33}) {
    const Image ours = numbered(size), theirs = strip_to_opengl(ours);
    EXPECT_NE(theirs.pixels, ours.pixels) << size;  // the faces about X are exchanged
    EXPECT_EQ(strip_from_opengl(theirs).pixels, ours.pixels) << size;
    EXPECT_EQ(strip_to_opengl(strip_from_opengl(ours)).pixels, ours.pixels) << size;
  }
}

// EXT_lights_image_based: the same faces, bottom row first.
TEST(LookupCube, FacesOfTheGltfExtensionAreTheSameUpsideDown) {
  const int size = 7;
  const Image ours = numbered(size), theirs = strip_to_opengl(ours);
  for (int face = 0; face < 6; ++face) {
    const Image image = lookup_face(ours, face);
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        EXPECT_EQ(image.rgb(x, size - 1 - y), theirs.rgb(x, face * size + y)) << face;
  }
}

}  // namespace
}  // namespace lightkiln
