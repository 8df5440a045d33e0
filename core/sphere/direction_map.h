#pragma once

// Orientation has this one home. World: right-handed, +Y up, as glTF.
//
// Lat-long, as OpenEXR's environment-map standard: the image centre looks at +Z, +X lies at
// longitude +pi/2, which is left of the centre; the top row is +Y. Seen from inside, unmirrored.
// Cube: six square faces stacked top to bottom +X -X +Y -Y +Z -Z, oriented as that standard says.
// Texel centres lie at (i + 1/2)/N.

#include <array>

#include "core/base/math.h"
#include "core/image/image.h"

namespace lightkiln {

// Longitude in (-pi, pi], 0 at +Z, +pi/2 at +X; latitude in [-pi/2, pi/2], +pi/2 at +Y.
// u in [0, 1) runs left to right, v in [0, 1] top to bottom.
Vec3d latlong_direction(double u, double v);
void latlong_coordinates(const Vec3d& direction, double* u, double* v);

// Face 0..5 = +X -X +Y -Y +Z -Z; s, t in [0, 1] from the left and the top edge of the face as
// stored. The result is a unit vector.
Vec3d cube_direction(int face, double s, double t);
void cube_coordinates(const Vec3d& direction, int* face, double* s, double* t);

// The centre of texel (x, y) of face `face` of a cube with `size` texels a side.
Vec3d cube_texel_direction(int face, int x, int y, int size);

}  // namespace lightkiln
