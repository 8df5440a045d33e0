// A cross is the cube unfolded about +Z, so that neighbours in the picture are neighbours on the
// cube. With OpenEXR's faces (direction_map.cpp) +X, +Z, -X and -Z join left to right as stored. +Y
// as stored runs down to -Z and -Y runs down to +Z: above and below +Z both need half a turn, and
// so does -Z when it hangs below -Y.

#include "core/sphere/cube_cross.h"

#include <array>

namespace lightkiln {

namespace {

constexpr std::array<FacePlace, 6> kStrip = {
    {{0, 0, false}, {0, 1, false}, {0, 2, false}, {0, 3, false}, {0, 4, false}, {0, 5, false}}};
constexpr std::array<FacePlace, 6> kHorizontal = {
    {{0, 1, false}, {2, 1, false}, {1, 0, true}, {1, 2, true}, {1, 1, false}, {3, 1, false}}};
constexpr std::array<FacePlace, 6> kVertical = {
    {{0, 1, false}, {2, 1, false}, {1, 0, true}, {1, 2, true}, {1, 1, false}, {1, 3, true}}};

const std::array<FacePlace, 6>& places(LayoutKind kind) {
  if (kind == LayoutKind::horizontal_cross) return kHorizontal;
  return kind == LayoutKind::vertical_cross ? kVertical : kStrip;
}

}  // namespace

FacePlace face_place(LayoutKind kind, int face) {
  return places(kind)[static_cast<size_t>(face)];
}

int face_at(LayoutKind kind, int column, int row) {
  for (int face = 0; face < 6; ++face) {
    const FacePlace place = face_place(kind, face);
    if (place.column == column && place.row == row) return face;
  }
  return -1;
}

}  // namespace lightkiln
