#include "tests/support/probe_bake.h"

#include <algorithm>

#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln::test {

ProbesHandle open_probes(const SceneData& data, std::optional<Environment> environment,
                         const ProbesOrder& order, int threads) {
  ProbesHandle state(new ProbesState);
  ProbesParameters parameters;
  parameters.positions = order.positions;
  parameters.cubemap.size = order.size;
  parameters.sh.bands = order.bands;
  parameters.max_bounces = order.max_bounces;
  state->spec.parameters = parameters;
  state->spec.accuracy.target_error = order.target;
  state->spec.accuracy.max_samples = order.max_samples;
  state->spec.accuracy.max_seconds = order.max_seconds;
  state->spec.seed = order.seed;
  state->grants.threads = threads;
  state->scene = make_scene(data);
  state->environment = std::move(environment);
  state->survey = survey_light(state->scene, state->light());
  TracerOptions options;
  options.alpha_test = state->survey.alpha_tested;
  state->tracer = std::make_unique<Tracer>(state->scene, options);
  return state;
}

std::vector<ProbeResult> read_probes(const ProbesState& state, const ChunkResult& chunk) {
  ByteReader reader(chunk.bytes);
  std::vector<ProbeResult> results;
  while (!reader.at_end()) {
    results.push_back(read_probe(reader, state.parameters(), results.size()));
  }
  return results;
}

BakedProbes bake_probes(ProbesHandle& state) {
  Progress progress;
  BakedProbes baked;
  baked.plan = probes_plan(*state, progress);
  baked.chunk = probes_chunk(*state, baked.plan, {0, baked.plan.elements}, progress);
  baked.probes = read_probes(*state, baked.chunk);
  return baked;
}

SceneData room(float albedo, float emission) {
  SceneData data;
  data.parts.push_back({reversed(make_box({-1, -1, -1}, {1, 1, 1})), grey(albedo, emission), {}});
  return data;
}

SceneData colored_room() {
  SceneData data;
  const MeshData box = reversed(make_box({-1, -1, -1}, {1, 1, 1}));
  const Material walls[] = {diffuse({0.7f, 0.1f, 0.1f}), diffuse({0.1f, 0.7f, 0.1f}), grey(0.6f)};
  for (size_t face = 0; face < 6; ++face) {
    MeshData wall = box;
    wall.triangles = {box.triangles[2 * face], box.triangles[2 * face + 1]};
    data.parts.push_back({wall, walls[std::min<size_t>(face, 2)], {}});
  }
  data.parts.push_back(
      {make_quad({-0.4f, 0.95f, -0.4f}, {0.8f, 0, 0}, {0, 0, 0.8f}), grey(0.3f, 8), {}});
  data.parts.push_back({make_box({-0.6f, -1, -0.5f}, {-0.1f, -0.2f, 0.1f}), grey(0.5f), {}});
  return data;
}

SceneData black_floor() {
  SceneData data;
  data.parts.push_back({make_quad({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}), grey(0), {}});
  return data;
}

Environment gradient_sky() {
  Environment sky = constant_environment({1, 1, 1});
  sky.constant = false;
  sky.radiance = Image(64, 32, 3);
  Vec3d sum;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / 64, (y + 0.5) / 32);
      const Vec3 value = to_float(Vec3d{1 + 0.5 * d.x, 1 + 0.5 * d.y, 1 + 0.5 * d.z});
      std::copy_n(&value.x, 3, sky.radiance.at(x, y));
      sky.max_luminance = std::max(sky.max_luminance, luminance(to_double(value)));
    }
  }
  sky.mean = {1, 1, 1};
  return sky;
}

SunnySky sunny_sky(int height, int column, int row, double energy) {
  SunnySky made;
  made.sky = constant_environment({1, 1, 1});
  made.sky.constant = false;
  made.sky.radiance = Image(2 * height, height, 3);
  std::fill(made.sky.radiance.pixels.begin(), made.sky.radiance.pixels.end(), 1.0f);
  const double omega = latlong_texel_solid_angle(row, 2 * height, height);
  const auto radiance = static_cast<float>(1 + energy / omega);
  for (int c = 0; c < 3; ++c) made.sky.radiance.at(column, row)[c] = radiance;
  made.direction =
      latlong_direction((column + 0.5) / (2 * height), (row + 0.5) / static_cast<double>(height));
  made.energy = (static_cast<double>(radiance) - 1) * omega;
  made.sky.max_luminance = static_cast<double>(radiance);
  const double mean = 1 + made.energy / (4 * kPi);
  made.sky.mean = {mean, mean, mean};
  return made;
}

}  // namespace lightkiln::test
