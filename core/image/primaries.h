#pragma once

// From the colour primaries that a file states to Rec. 709, the one colour space inside.

#include "core/image/image.h"

namespace lightkiln {

// CIE 1931 chromaticities x, y.
struct Chromaticity {
  double x = 0, y = 0;
};
struct Primaries {
  Chromaticity red{0.64, 0.33};
  Chromaticity green{0.30, 0.60};
  Chromaticity blue{0.15, 0.06};
  Chromaticity white{0.3127, 0.3290};  // the defaults are Rec. 709
};

struct ColorMatrix {
  double m[3][3] = {};
};

// Linear RGB of `from` to linear Rec. 709 RGB. White goes to white: (1, 1, 1) stays (1, 1, 1).
// Throws Error{invalid_input} when the primaries span no colour space.
ColorMatrix matrix_to_rec709(const Primaries& from);

// Converts an image of three channels in place. Leaves every bit alone when the primaries are Rec.
// 709 to within 1e-4, the precision in which files state them.
void convert_to_rec709(Image& image, const Primaries& from);

}  // namespace lightkiln
