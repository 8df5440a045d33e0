#pragma once

// What a bake will do, decided before it starts: effects on or off with reasons and bounds,
// elements, chunks, pinned sample counts and prices. All but the seconds is a pure function of spec
// and inputs, and the seconds never reach a chunk's bytes.

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/bake/accuracy.h"
#include "core/bake/spec.h"

namespace lightkiln {

// The version that names a result: any change of results raises it.
inline constexpr const char* kEngineVersion = LIGHTKILN_VERSION;

struct Effect {
  std::string name;  // stable: "environment", "environment_variation", "emissive_surfaces", ...
  bool active = false;
  std::string reason;  // one sentence
  // The most that leaving it out could change a result, in the unit of target_error; 0 = nothing.
  double bound = 0;
};

struct ElementRange {
  uint64_t first = 0;
  uint64_t count = 0;
};

struct Plan {
  Kind kind = Kind::ambient_occlusion;
  std::string engine_version = kEngineVersion;
  // The instruction set that rays are traced with. Equal plans give equal bytes where it is equal,
  // on C libraries that compute equal powers, exponentials and logarithms: of probes the table that
  // decodes sRGB textures rests on powers, the error and with it the number of doublings on the
  // quantile of F, and the number of bounces on a power of the largest albedo. Sines, cosines and
  // arc tangents are our own and the same everywhere.
  std::string isa;
  std::vector<Effect> effects;
  std::vector<std::string> warnings;
  std::vector<std::pair<std::string, uint64_t>>
      repairs;  // counts of what loading repaired or ignored
  uint64_t elements = 0;
  std::string element_unit;          // "vertex", "output", "probe"
  std::vector<ElementRange> chunks;  // in order, covering [0, elements)
  // Pinned: a chunk reads these and never a clock.
  uint64_t min_samples = 0;
  uint64_t max_samples = 0;
  int max_bounces = 0;
  double reference_luminance = 0;  // probes: the job's mean luminance from the pilot; 1 otherwise
  std::vector<Price> prices;       // for kQuotedErrors
  // What the effects left out as negligible and the bounces past the last take from a result at the
  // most, in the unit of target_error. Up to a fifth of target_error it is part of the order: the
  // rest is what is left for noise. Above that it stands beside the error, and a warning says so.
  double bias_bound = 0;
  double predicted_s = 0;      // wall seconds of baking as ordered
  double predicted_low_s = 0;  // a 90 % interval around it, on a machine as busy as the pilot's
  double predicted_high_s = 0;
  double pilot_s = 0;
};

}  // namespace lightkiln
