#pragma once

// Ambient occlusion of small scenes through the front door, step by step.

#include <string>
#include <variant>
#include <vector>

#include "core/bake/bake.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln::test {

// An order for the one scene that bake_ao() hands over, with default parameters.
Spec ao_order(double target = 0.02);
AmbientOcclusionParameters& ao_parameters(Spec& spec);

struct BakedAo {
  Plan plan;
  std::vector<std::byte> bytes;  // of all chunks, joined
  std::vector<float> openness, errors;
  Assembly assembly;

  const AoDocument& document() const { return std::get<AoDocument>(assembly.document); }
};

// `chunks` = 0 takes the plan's own.
BakedAo bake_ao(const std::vector<std::byte>& glb, const Spec& spec, int threads = 1,
                uint64_t chunks = 0);
BakedAo bake_ao(const MeshData& mesh, const Spec& spec, int threads = 1, uint64_t chunks = 0);

// A floor with a sphere and a box on it: every kind of vertex.
MeshData still_life();

// The digest that ao_order() names its scene by.
std::string ao_digest();

}  // namespace lightkiln::test
