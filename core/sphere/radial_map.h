#pragma once

// Layouts whose texels at one radius share one angle from the axis: angular map, mirror balls,
// hemispheres. The disc of radius 1 touches the image's borders.

#include "core/sphere/map_layout.h"

namespace lightkiln {

bool is_radial(LayoutKind kind);

// Angle from the axis at radius r in [0, 1], rising; and back: a radius in [0, 1], or above 1 when
// the angle is not covered.
double radial_angle(const MapLayout& layout, double radius);
double radial_radius(const MapLayout& layout, double angle_rad);
// The angle at the rim.
double radial_limit(const MapLayout& layout);
// d(solid angle) / d(area) of the unit disc.
double radial_density(const MapLayout& layout, double radius);

// (right, up) in the unit disc, and the direction.
Vec3d radial_direction(const MapLayout& layout, double right, double up);
// At an angle from the axis, towards the unit vector (right, up).
Vec3d radial_direction_at(const MapLayout& layout, double right, double up, double theta_rad);
// False when the direction is not covered.
bool radial_coordinates(const MapLayout& layout, const Vec3d& direction, double* right, double* up);

// Solid angle shown by the rectangle [x0, x1] x [y0, y1] of the disc's plane.
double radial_solid_angle(const MapLayout& layout, double x0, double x1, double y0, double y1);

}  // namespace lightkiln
