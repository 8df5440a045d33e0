#pragma once

// The sphere on a square [-1, 1]^2 folded about z: |x| + |y| <= 1 shows z >= 0, the corners z < 0.

#include "core/base/math.h"

namespace lightkiln {

// Central projection onto the octahedron |x| + |y| + |z| = 1, unfolded. Z. Cigolle et al., "A
// Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), 2014.
Vec3d octahedral_direction(double x, double y);
void octahedral_coordinates(const Vec3d& direction, double* x, double* y);
// d(solid angle) / d(area) of the square.
double octahedral_density(double x, double y);
// Solid angle shown by the rectangle [x0, x1] x [y0, y1].
double octahedral_solid_angle(double x0, double x1, double y0, double y1);

// Equal-area: density pi everywhere. P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere
// using SIMD", Journal of Graphics Tools 13(3), 2008.
Vec3d equal_area_direction(double x, double y);
void equal_area_coordinates(const Vec3d& direction, double* x, double* y);

// The folded corner 1..4 that shows a direction with z < 0, by the signs of x and y; 0 for z >= 0.
int octahedral_corner(const Vec3d& direction);

}  // namespace lightkiln
