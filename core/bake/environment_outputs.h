#pragma once

// The elements of an environment_maps bake: its ordered outputs in a fixed order, and what each
// costs.

#include <optional>
#include <string>
#include <vector>

#include "core/bake/plan.h"
#include "core/environment/prefilter.h"

namespace lightkiln {

enum class OutputKind { sh, irradiance, level, dfg };

struct EnvironmentOutput {
  OutputKind kind = OutputKind::sh;
  int size = 0;          // bands, face size or table size
  int index = 0;         // of a level
  double roughness = 0;  // of a level

  // The convolution it needs, if any.
  std::optional<double> alpha() const;
};

// SH, irradiance, levels from the sharpest, DFG: those that are ordered.
std::vector<EnvironmentOutput> ordered_outputs(const EnvironmentMapsParameters& parameters);

// The bound that an order of `target_error` is baked to. A bound is an rms over the sphere; a tenth
// of the order leaves room for the single texel.
double working_target(double target_error);

// Lobes for the outputs that need one, in their order; empty ones (no bands) for the others.
std::vector<LobePlan> plan_lobes(const LightStatistics& light,
                                 const std::vector<EnvironmentOutput>& outputs, double target);

// CPU seconds of the whole bake by operation counts, each with the time it took on a 3 GHz core.
double model_seconds(const Environment& environment, const LightStatistics& light,
                     const std::vector<EnvironmentOutput>& outputs,
                     const std::vector<LobePlan>& lobes);

// The bands of the map that must be known.
int transform_bands(const std::vector<EnvironmentOutput>& outputs,
                    const std::vector<LobePlan>& lobes);

// This machine's time over that of the model's core, from a run of under a millisecond.
double measure_speed();

}  // namespace lightkiln
