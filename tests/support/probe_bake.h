#pragma once

// Small scenes baked as probes, without files.

#include <memory>
#include <optional>
#include <vector>

#include "core/bake/probes_state.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {

struct ProbesOrder {
  std::vector<Vec3d> positions = {{0, 0, 0}};
  int size = 8;
  int bands = 3;
  std::optional<int> max_bounces;
  double target = 0.05;
  std::optional<uint64_t> max_samples;
  std::optional<double> max_seconds;
  uint64_t seed = 0;
};

using ProbesHandle = std::unique_ptr<ProbesState, ProbesStateDeleter>;
ProbesHandle open_probes(const SceneData& data, std::optional<Environment> environment,
                         const ProbesOrder& order, int threads = 1);

struct BakedProbes {
  Plan plan;
  ChunkResult chunk;
  std::vector<ProbeResult> probes;
};
BakedProbes bake_probes(ProbesHandle& state);
std::vector<ProbeResult> read_probes(const ProbesState& state, const ChunkResult& chunk);

// A room of 2 m a side about the origin.
SceneData room(float albedo, float emission);
// The same with three colours of walls, a lamp under the ceiling and a block.
SceneData colored_room();

// A black plane of 100 m a side through the origin, seen from above.
SceneData black_floor();

// 1 + d / 2, each channel by the coordinate of direction d that it is named after.
Environment gradient_sky();

// A sky of radiance 1 with a sun of one texel of a map of `height` rows: `energy` is the sun's
// term of L00 / y_00, radiance times solid angle.
struct SunnySky {
  Environment sky;
  Vec3d direction;
  double energy = 0;
};
SunnySky sunny_sky(int height, int column, int row, double energy);

}  // namespace lightkiln::test
