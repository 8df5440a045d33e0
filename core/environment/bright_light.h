#pragma once

// What a band limit cuts off the brightest texels, in closed form.

#include <vector>

#include "core/environment/light_statistics.h"
#include "core/environment/lobe.h"

namespace lightkiln {

// Bright texels are cut into cells, near squares of at most `phase` over the number of bands a
// side. Each acts as a point whose kernel is the mean over a square of their common size, but for
// the kink on the kernel's horizon: under a sun it would show, and is averaged over each cell's own
// rectangle.
// The bright texels as such points, and the part of a kernel that bands l < responses.size() lack.
class CutLight {
 public:
  CutLight(const LightStatistics& light, const ZonalKernel& kernel,
           const std::vector<double>& responses, double phase);
  // To be added to the band-limited convolution at this direction.
  Vec3d at(const Vec3d& direction) const;

 private:
  // What the rectangle of a cell needs beside its middle.
  struct Cell {
    Vec3d energy;
    Vec3d across, down;  // half the sides, along longitude and colatitude
    double reach;        // no corner is farther
    double shrink;       // of the mean of a cosine over the cell: its mean direction's length
  };
  std::vector<double> x_, y_, z_;  // directions of the cells' middles
  std::vector<Cell> cells_;
  double slope_;               // of the kink
  std::vector<double> table_;  // of the rest, by angle in equal steps from 0 to pi, and one more
};

// How many points there are.
int cut_light_points(const LightStatistics& light, int bands, double phase);
// What they may leave, when bands l < bands are taken from the map: rms over the sphere relative to
// the mean. `responses`, the kernel's, reach beyond `bands` as far as they are known.
double cut_light_bound(const LightStatistics& light, const ZonalKernel& kernel,
                       const std::vector<double>& responses, int bands, double phase);
// The largest phase whose bound is at most `allowance`, the share kPhaseShare of a target; where
// points would become too many, that of the least bound.
inline constexpr double kPhaseShare = 0.25;
double cut_light_phase(const LightStatistics& light, const ZonalKernel& kernel,
                       const std::vector<double>& responses, int bands, double allowance);

}  // namespace lightkiln
