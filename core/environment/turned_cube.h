#pragma once

// A lat-long map whose turn is pending, by area on the faces of a cube: resample_to_cube() walks
// grids that only an unturned cube shares with the map.

#include "core/base/progress.h"
#include "core/environment/environment.h"

namespace lightkiln {

// How a cube of one size is made to an ordered error: root mean square over the sphere, relative to
// the map's mean luminance.
struct TurnedCubePlan {
  // Of every texel in which nothing is brighter than kTurnedBright times the mean, relative to its
  // brightest or the mean: what convert_layout() is asked for.
  double conversion_error = 0;
  // Of the others, which are summed meridian by meridian; over the sphere.
  double bright_error = 0;
  double error_bound = 0;  // of the whole; above the order where that is finer than can be made
};
inline constexpr double kTurnedBright = 64;
TurnedCubePlan plan_turned_cube(const Environment& environment, double error);

// Each texel is the mean of the map, constant on each of its texels, over the solid angle of the
// cube's texel, turned by what is pending. The same bits for any number of threads.
Image turn_to_cube(const Environment& environment, const TurnedCubePlan& plan, int face_size,
                   int threads, Progress& progress);

}  // namespace lightkiln
