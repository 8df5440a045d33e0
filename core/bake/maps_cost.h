#pragma once

// What environment maps cost: seconds an operation on a 3 GHz core, measured on a 2048 x 1024 map.
// A plan multiplies its operation counts by these and by this machine's speed.

#include "core/environment/layout_convert.h"

namespace lightkiln {

inline constexpr double kDecodePerTexel = 4e-9;      // statistics; decoding is the input's own time
inline constexpr double kFourierPerPoint = 4.4e-10;  // times log2 of the width, a power of two
inline constexpr double kOddFourier = 11;            // times as much for other widths
inline constexpr double kDirectPerTexel = 9e-10;     // of rows summed directly, and an order more:
inline constexpr double kDirectPerOrder = 1.45e-10;
inline constexpr double kLegendrePerTerm = 1e-10;  // and point in a row
inline constexpr double kRingPerTerm = 6.6e-10;    // bands^3
inline constexpr double kRingPerPoint = 7.5e-9;    // of the grid of rings
inline constexpr double kPerTexel = 4e-8;          // interpolation
inline constexpr double kPerBrightPoint = 3e-9;
inline constexpr double kPerCorePoint = 4e-9;
inline constexpr double kResamplePerCell = 1.3e-8;
// Another layout: by what convert_layout() counts.
inline constexpr double kConvertPerTexel = 4e-8;
inline constexpr double kConvertPerPlace = 1e-7;
inline constexpr double kConvertPerPolygon = 8e-8;
inline constexpr double kConvertPerCovered = 5e-8;
inline constexpr double kConvertPerPoint = 1e-8;
// Beside what walks over whole grids.
inline double conversion_seconds(const ConversionWork& work) {
  return kConvertPerTexel * work.texels + kConvertPerPlace * work.per_place * work.places +
         kConvertPerPolygon * work.polygons + kConvertPerCovered * work.covered +
         kConvertPerPoint * work.points;
}
inline constexpr double kConvertPerCheck = 1.1e-3;  // and as much for each source texel across one
inline constexpr double kBallCheck = 2.5;           // times that on a mirror ball
inline constexpr double kLookUpPerTexel = 2.5e-7;   // of the source, for the round trip
inline constexpr double kPerDfgPoint = 3.1e-9;
inline constexpr double kPerCharliePoint = 9e-9;
inline constexpr double kRgbdPerTexel = 4e-7;  // packing and writing PNG
inline constexpr double kSunPerTexel = 6e-9;
inline constexpr double kLightSetPerTexel = 8e-9;  // into cells
inline constexpr double kLightSetSeconds = 0.3;    // nine sets of 1 to 256 lights and their errors
inline constexpr double kBrutePerTexel = 2e-9;     // of the map, each texel that is checked

inline constexpr double kEnergyPerTexel = 2e-9;
// Windows look for extremes on grids of 32 points a band squared; `minimal` does so about 20 times.
inline constexpr double kWindowSearches = 20;
inline constexpr double kPerSearch = 6e-6;  // bands^2

// This machine's time over that of the model's core, from a run of under a millisecond.
double measure_speed();

}  // namespace lightkiln
