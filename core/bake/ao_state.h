#pragma once

// What an ambient-occlusion job holds between its steps, and the parts its steps share.

#include <optional>

#include "core/bake/kitchen.h"
#include "core/bake/openness.h"
#include "core/bake/vertex_facets.h"
#include "core/trace/tracer.h"

namespace lightkiln {

struct AoState {
  Spec spec;
  Grants grants;
  GltfSource source;
  Scene scene;
  std::optional<Tracer> tracer;
  std::optional<VertexFacets> facets;

  const AmbientOcclusionParameters& parameters() const {
    return std::get<AmbientOcclusionParameters>(spec.parameters);
  }
};

// The order in scene units. `max_distance` is infinite when no two points of the scene are that
// far apart and the falloff does not depend on it.
OpennessParameters openness_parameters(const AoState& state);

// Estimates the elements ids[i] on the granted threads. Reports of blocks are summed in order.
struct OpennessBatch {
  std::vector<OpennessEstimate> estimates;
  ChunkReport report;
  std::vector<std::vector<double>> history;  // [round][element], when asked for
};
OpennessBatch estimate_vertices(const AoState& state, const OpennessKernel& kernel,
                                std::span<const uint64_t> ids, bool keep_history,
                                Progress& progress);

}  // namespace lightkiln
