#pragma once

// How an image covers the sphere of directions. Every layout, in this one place.
//
// All but the octahedral ones are pictures seen from inside, upright and unmirrored, that face +Z:
// the image centre looks at +Z and -X lies to the right of it (hemispheres: the centre looks at +Y,
// and +Z lies at the bottom edge, as in a planetarium). The octahedral ones are the published
// formulas as shaders write them, column from x, row from y, folded about z: the centre looks at
// +Z, +X lies to the right and +Y at the bottom edge; that, too, is unmirrored, but upside down.

#include <optional>

#include "core/base/math.h"

namespace lightkiln {

enum class LayoutKind {
  latlong,                // any size; 2:1 by custom
  cube_strip,             // N x 6N: +X -X +Y -Y +Z -Z from the top, as OpenEXR orients them
  horizontal_cross,       // 4N x 3N: row +X +Z -X -Z, +Y above and -Y below +Z
  vertical_cross,         // 3N x 4N: column +Y +Z -Y -Z (upside down), +X left and -X right of +Z
  angular,                // N x N: radius proportional to the angle from +Z, pi at the rim
  mirror_ball,            // N x N: a mirror ball seen from +Z
  octahedral,             // N x N: Cigolle et al. 2014
  equal_area_octahedral,  // N x N: Clarberg 2008, as in pbrt-v4
  hemisphere,             // N x N: upper half; radius proportional to the angle from +Y
  hemisphere_equal_area,  // N x N: upper half; Lambert's azimuthal projection
  cylinder,               // W x H: on a cylinder about Y, square texels at its equator
  cylinder_equal_area,    // W x H: Lambert's cylindrical projection, the whole sphere
};

enum class TexelConvention {
  half_texel,  // centres at (i + 1/2)/N
  openexr      // centres on the borders, i/(N - 1): lat-long and cube strip only
};

struct MapLayout {
  LayoutKind kind = LayoutKind::latlong;
  int width = 0, height = 0;  // of the whole image, at least 1 (openexr: 2 a side)
  TexelConvention convention = TexelConvention::half_texel;
  // Mirror ball: the camera's distance from the ball's centre in radii of the ball, above 1; 0 =
  // infinitely far (orthographic). The outline of the ball touches the image's borders.
  double camera_distance = 0;
  // Angular map and mirror ball: left and right exchanged, which is what a camera sees on a real
  // ball and what the formula of Debevec's gallery says: +X to the right of +Z.
  bool mirrored = false;

  friend bool operator==(const MapLayout& a, const MapLayout& b) = default;
};

// Where a direction lies in the image: texel i covers [i, i + 1] with its sample at i + 1/2, in
// either convention (with `openexr` the sphere ends at 1/2 and N - 1/2).
struct MapPlace {
  double x = 0, y = 0;
  // Places of one chart are joined by straight paths that stay close in direction; 0 joins any.
  // Cubes: face + 1. Octahedral: the four folded corners 1..4 about -Z, and 0.
  int chart = 0;
};

// Names as in specs ("cube_strip"), and what a person would call it.
const char* layout_name(LayoutKind kind);

// What is wrong with the size or the parameters ("A horizontal cross is 4N x 3N texels"), or
// nullptr.
const char* layout_fault(const MapLayout& layout);

// The smallest layout of a kind by its one size: N of the list above; for lat-long and cylinders
// the width, with height = width / 2.
MapLayout make_layout(LayoutKind kind, int size);

bool is_cube(LayoutKind kind);
// N of a cube layout.
int cube_face_size(const MapLayout& layout);
// Columns of a whole turn, of layouts whose left border continues the right one; 0 of others.
int turn_columns(const MapLayout& layout);

// The unit vector that the image shows at (x, y); nothing where it shows none (outside the disc,
// the empty squares of a cross).
std::optional<Vec3d> layout_direction(const MapLayout& layout, double x, double y);

// Where a unit vector lies; nothing where the layout does not cover it. The inverse of the above to
// 1e-12 of the direction, except where the image stands still while the direction moves: within 0.1
// degrees of the rim of a mirror ball, all of which is one direction, and of the lower pole of the
// equal-area cylinder 1e-16 of the side remains, which is 1e-8 rad at worst.
std::optional<MapPlace> layout_place(const MapLayout& layout, const Vec3d& direction);

bool layout_covers(const MapLayout& layout, const Vec3d& direction);
// The texel's sample has a direction.
bool texel_has_direction(const MapLayout& layout, int x, int y);

// Solid angle of what texel (x, y) shows, in steradians; 0 where it shows nothing. Closed form for
// lat-long, cubes, cylinders, octahedral ones; else by 16-point quadrature along its outline. Sums
// to covered_solid_angle() within 1e-11.
double texel_solid_angle(const MapLayout& layout, int x, int y);
double covered_solid_angle(const MapLayout& layout);
// Solid angle per texel area at a place, in steradians.
double solid_angle_density(const MapLayout& layout, double x, double y);

// The texel that continues the image at (x, y), which may lie one texel outside it or outside a
// face of `chart`; false where nothing continues it (a cube's corner, the rim of a disc).
bool continue_texel(const MapLayout& layout, int chart, int* x, int* y);

}  // namespace lightkiln
