#pragma once

// Rotation of real spherical harmonics, band by band.

#include "core/sphere/harmonics.h"

namespace lightkiln {

// The coefficients of g(d) = f(R^-1 d): light turned by R, a proper rotation in row-major order.
ShRgb sh_rotate(const ShRgb& sh, const double rotation[3][3]);

}  // namespace lightkiln
