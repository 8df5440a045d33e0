#pragma once

// A cube as graphics interfaces look it up: the six images that OpenGL, Direct3D, WebGL and the
// engines above them take and give.
//
// Theirs are cube map faces of OpenGL's table in a left-handed world (-x, y, z): a cube seen from
// inside shows what it should in a world of the other hand. Ours of +-X are theirs of -+X. Texels
// are moved, never filtered.

#include "core/image/image.h"

namespace lightkiln {

// How the six square images of a cube, +X -X +Y -Y +Z -Z, are turned. Crosses are the same picture
// in either: cut into upright squares they are OpenGL's faces.
enum class FaceOrientation {
  openexr,  // as OpenEXR's cube, which is ours: see direction_map.h
  opengl,   // as above, rows from the top as image files have them
};
// As in specs and files: "openexr", "opengl".
const char* face_orientation_name(FaceOrientation orientation);
// The text attribute by which an OpenEXR file of ours names it; openexr goes without.
inline constexpr const char* kFaceOrientationAttribute = "lightkiln.face_orientation";

// Strips of six faces, N x 6N, from one orientation to the other, texels of either convention. The
// one undoes the other to the bit.
Image strip_to_opengl(const Image& strip);
Image strip_from_opengl(const Image& strip);

// Face 0..5 of our strip as an image of EXT_lights_image_based: OpenGL's, bottom row first.
Image lookup_face(const Image& strip, int face);

}  // namespace lightkiln
