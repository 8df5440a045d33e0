#pragma once

// Texels at the rim of a disc (angular map, mirror ball, hemispheres), in pieces on which the
// direction is smooth up to the rim.
//
// In the image's own coordinates it is not: at the rim of a ball the angle from the axis grows as
// the square root of what is left of the radius, so that a single texel shows many degrees and any
// rule that takes its cells for polygons or steps along it evenly errs at a low order; and the rim
// cuts through texels. In polar coordinates (phi, theta), theta the angle from the axis, both are
// gone: the rim is theta = const, and d(omega) = sin(theta) d(theta) d(phi).

#include <vector>

#include "core/sphere/map_layout.h"

namespace lightkiln {

// A piece of a texel between two of its sides and two angles from the axis: at each theta an arc.
// b in [0, 1] runs in theta from inner_rad to outer_rad, a in [0, 1] in phi along the arc.
struct RimPatch {
  // x = at or y = at in the unit disc's quadrant of x, y >= 0.
  struct Side {
    bool vertical = false;
    double at = 0;
  };
  double inner_rad = 0, outer_rad = 0;
  Side first, last;
  double sign_x = 1, sign_y = 1;  // of the quadrant that the texel is in, x to the right and y up
};

struct RimPoint {
  Vec3d direction;
  double x = 0, y = 0;  // in the image, as layout_direction() takes them
};

// What texel (x, y) shows, in pieces, when the rim of a disc crosses it or is within a texel, of a
// ball within three; else none.
std::vector<RimPatch> rim_patches(const MapLayout& layout, int x, int y);

RimPoint rim_point(const MapLayout& layout, const RimPatch& patch, double a, double b);

// d(omega) / (da db) in steradians, at any a.
double rim_density(const MapLayout& layout, const RimPatch& patch, double b);

// Solid angle of [a0, a1] x [b0, b1]: by three Gauss points in theta.
double rim_solid_angle(const MapLayout& layout, const RimPatch& patch, double a0, double a1,
                       double b0, double b1);

}  // namespace lightkiln
