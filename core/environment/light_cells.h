#pragma once

// A map as a few tens of thousands of small cells of light: what sums over directions need, without
// a look at every texel. No light is lost in them.

#include <vector>

#include "core/base/progress.h"
#include "core/environment/environment.h"

namespace lightkiln {

struct LightCell {
  Vec3d energy;       // integral of radiance over the cell, per channel
  Vec3d centre;       // luminance-weighted mean direction; a little shorter than 1
  double weight = 0;  // luminance of `energy`, > 0
  double extent = 0;  // half the width that the cell has if its light is spread evenly, radians
};

struct LightCells {
  std::vector<LightCell> cells;  // black ones are left out
  Vec3d energy;                  // of all: 4 pi times the map's mean radiance
  double weight = 0;             // its luminance
};

// Blocks of at most 1.4 degrees, cut in four as long as they hold more than a thousandth of the
// light and more than one texel.
LightCells gather_light(const Environment& environment, int threads, Progress& progress);

// Irradiance on a surface with the unit normal. Exact for cells wholly above or below the horizon;
// across it a cell counts as evenly lit.
Vec3d cell_irradiance(const LightCells& light, const Vec3d& normal);

}  // namespace lightkiln
