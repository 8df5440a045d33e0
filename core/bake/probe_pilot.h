#pragma once

// Runs before the bake: which probes stand for all, and the job's mean luminance.

#include <cstdint>
#include <vector>

#include "core/bake/probes_state.h"

namespace lightkiln {

// Up to four probes spread over the list, free ones first (inside a solid there is no light to
// learn from).
std::vector<uint64_t> pilot_probes(const ProbesState& state);

// The mean luminance over the sphere around the pilot probes, with every effect the survey calls
// for: a pure function of spec and inputs. 0 when no light was found.
double pilot_luminance(ProbesState& state, const std::vector<uint64_t>& probes, Progress& progress);

}  // namespace lightkiln
