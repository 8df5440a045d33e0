#pragma once

// Where the six faces lie in a strip and in the two crosses.

#include "core/sphere/map_layout.h"

namespace lightkiln {

// A square of the image in units of the face size; faces that are turned by half a turn show the
// strip's face upside down, which is what unfolding the cube does to them.
struct FacePlace {
  int column = 0, row = 0;
  bool half_turn = false;
};

// `kind` is a cube layout; face 0..5 = +X -X +Y -Y +Z -Z.
FacePlace face_place(LayoutKind kind, int face);
// The face that covers a square of the image, or -1.
int face_at(LayoutKind kind, int column, int row);

}  // namespace lightkiln
