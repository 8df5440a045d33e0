#include "tests/support/ao_bake.h"

#include <cstring>

namespace lightkiln::test {

std::string ao_digest() {
  return "sha256:" + std::string(64, '0');
}

Spec ao_order(double target) {
  Spec spec;
  spec.scene = InputRef{ao_digest(), {}};
  spec.parameters = AmbientOcclusionParameters{};
  spec.accuracy.target_error = target;
  return spec;
}
AmbientOcclusionParameters& ao_parameters(Spec& spec) {
  return std::get<AmbientOcclusionParameters>(spec.parameters);
}

BakedAo bake_ao(const std::vector<std::byte>& glb, const Spec& spec, int threads, uint64_t chunks) {
  Inputs inputs;
  inputs.blobs[ao_digest()] = glb;
  Grants grants;
  grants.threads = threads;
  Progress progress;
  Bake front_door(spec, inputs, grants);
  BakedAo baked;
  baked.plan = front_door.plan(progress);
  if (chunks > 0) {
    baked.plan.chunks.clear();
    for (uint64_t i = 0; i < chunks; ++i) {
      const uint64_t first = baked.plan.elements * i / chunks;
      baked.plan.chunks.push_back({first, baked.plan.elements * (i + 1) / chunks - first});
    }
  }
  std::vector<ChunkResult> results;
  for (const ElementRange& range : baked.plan.chunks) {
    results.push_back(front_door.chunk(baked.plan, range, progress));
    const std::vector<std::byte>& bytes = results.back().bytes;
    baked.bytes.insert(baked.bytes.end(), bytes.begin(), bytes.end());
  }
  baked.assembly = front_door.assemble(baked.plan, results, progress);
  for (size_t at = 0; at + 16 <= baked.bytes.size(); at += 16) {
    float values[2];
    std::memcpy(values, baked.bytes.data() + at, sizeof values);
    baked.openness.push_back(values[0]);
    baked.errors.push_back(values[1]);
  }
  return baked;
}
BakedAo bake_ao(const MeshData& mesh, const Spec& spec, int threads, uint64_t chunks) {
  return bake_ao(make_glb(mesh), spec, threads, chunks);
}

MeshData still_life() {
  MeshData mesh = test::make_grid(4, 12);
  mesh = merged(mesh, make_sphere({-1, 1, 0}, 1, 12, 24));
  return merged(mesh, make_box({1, 0, -1}, {2, 2, 1}));
}

}  // namespace lightkiln::test
