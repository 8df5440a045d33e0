#pragma once

// What a job of probes keeps between its steps, and what the steps share.

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/bake/kitchen.h"
#include "core/bake/probe_surroundings.h"
#include "core/base/statistics.h"
#include "core/trace/radiance.h"

namespace lightkiln {

struct ProbesState {
  Spec spec;
  Grants grants;
  Scene scene;
  std::optional<Environment> environment;
  std::vector<std::string> warnings;  // of the environment's files
  LightSurvey survey;
  std::unique_ptr<Tracer> tracer;
  std::unique_ptr<RadianceScene> radiance;  // of the selection asked for last

  const ProbesParameters& parameters() const { return std::get<ProbesParameters>(spec.parameters); }
  const Environment* light() const { return environment ? &*environment : nullptr; }
  Vec3 origin(uint64_t probe) const {
    return to_float(scene.normalisation.to_normalised(parameters().positions[probe]));
  }
  // The randomisation of one probe; `stream` keeps the pilot and the bake apart.
  uint64_t key(uint64_t stream, uint64_t probe) const;
  EffectOrder order(double reference_luminance) const {
    return {parameters().max_bounces, target_error(spec), reference_luminance};
  }
  const RadianceScene& radiance_for(const EffectSelection& selection);
};

inline constexpr uint64_t kBakeStream = 1;
inline constexpr uint64_t kPilotStream = 2;

// The selection that a plan stands for.
EffectSelection plan_selection(const ProbesState& state, const Plan& plan);

// What of the ordered error is left for noise.
double noise_target(const ProbesState& state, const Plan& plan);

// One probe's result, as chunk bytes carry it.
struct ProbeResult {
  uint64_t index = 0;
  ProbeSurroundings surroundings;
  AccuracyStatus accuracy = AccuracyStatus::converged;
  uint64_t samples = 0;  // a texel
  double error = 0;      // see ProbeDocument
  ShRgb sh;              // windowed as ordered
  double sh_error = 0;
  ShWindowReport window;
  std::vector<float> radiance;  // stacked cube, RGB
  std::vector<float> distance;  // stacked cube, world units, 0 = nothing hit
};
void write_probe(const ProbeResult& result, ByteWriter& writer);
// Throws Error{internal} for bytes that are not the result of probe `index`.
ProbeResult read_probe(ByteReader& reader, const ProbesParameters& parameters, uint64_t index);

}  // namespace lightkiln
