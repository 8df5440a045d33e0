#pragma once

// What the products made of coefficients share.

#include "core/bake/maps_output.h"

namespace lightkiln {

// The first `bands` bands as an order of `target` needs them: a hundredth of it in each
// coefficient, relative to L00, since windows, products and evaluations add up many of them.
ShNeed coefficients_need(int bands, double target);
// What is known of their error before the work: by the Gauss points that this need takes by itself
// on a map of `height` rows, and by rounding.
double coefficients_bound(const ShNeed& need, int height);

// `count` of the coefficients below `bands` against the plain sum over all texels, relative to L00.
MeasuredError check_coefficients(MapsLight& light, int bands, int count, Progress& progress);

// The first `bands` bands of radiance, of constant maps in closed form.
ShRgb radiance_coefficients(MapsLight& light, int bands, Progress& progress);

}  // namespace lightkiln
