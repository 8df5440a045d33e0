#pragma once

// What the products made of coefficients share.

#include "core/bake/maps_output.h"

namespace lightkiln {

// Quadrature along rows and rounding, relative to L00.
inline constexpr double kShErrorBound = 1e-7;

// `count` of the coefficients below `bands` against the plain sum over all texels, relative to L00.
MeasuredError check_coefficients(MapsLight& light, int bands, int count, Progress& progress);

// The first `bands` bands of radiance, of constant maps in closed form.
ShRgb radiance_coefficients(MapsLight& light, int bands, Progress& progress);

}  // namespace lightkiln
