// What probes were predicted to cost against what they cost, on scenes of every kind.
//
//   bench_probes [--smoke] [--plan] [name ...]
//
// On a busy machine wall time tells little; cpu is the prediction at the pilot's share of the
// processors. Scenes come from the data folder of the tests (see tests/support/data.h) and
// deploy/demo.

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "core/bake/bake.h"
#include "core/base/error.h"
#include "core/base/parallel.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

struct Case {
  const char* name;
  const char* scene;        // below the data folder, or of deploy/demo
  const char* environment;  // "" = none
  std::vector<Vec3d> positions;
  int size;
  double target_error;
};

const std::vector<Case>& cases() {
  static const char* const kSky = "environments/latlong_hdr/kloppenheim_05_1k.hdr";
  static const std::vector<Case> kCases = {
      {"cornell", "scenes/cornell_box/CornellBox.glb", kSky, {{-278, 273, -280}}, 64, 0.05},
      {"cornell_dark", "scenes/cornell_box/CornellBox.glb", "", {{-278, 273, -280}}, 64, 0.05},
      {"demo",
       "courtyard.glb",
       "sky.hdr",
       {{0, 2.2, 0}, {0, 1.6, -3.3}, {-4.4, 1.4, 1.6}},
       32,
       0.2},
      {"demo_fine",
       "courtyard.glb",
       "sky.hdr",
       {{0, 2.2, 0}, {0, 1.6, -3.3}, {-4.4, 1.4, 1.6}},
       32,
       0.1},
      {"hotel",
       "scenes/interior_hotel_room/hotel-room.decoded.glb",
       kSky,
       {{10000, 1200, -5000}},
       16,
       0.5},
      {"hall",
       "scenes/interior_volumetric_room/VolumetricFogExample.glb",
       kSky,
       {{0, 2, 0}},
       16,
       0.2},
      {"garden",
       "scenes/outdoor_bridge_garden/japanese-bridge-garden.decoded.glb",
       kSky,
       {{0, 4, 0}, {2, 3, 2}},
       32,
       0.05},
  };
  return kCases;
}

std::vector<std::byte> read(const std::string& path) {
  if (path.empty()) return {};
  const std::filesystem::path own =
      std::filesystem::path(LIGHTKILN_SOURCE_DIR) / "deploy" / "demo" / path;
  if (std::filesystem::exists(own)) return test::read_file(own);
  const auto data = test::data_folder();
  if (!data || !std::filesystem::exists(*data / path)) return {};
  return test::read_file(*data / path);
}

void run(const Case& order, bool smoke, bool plan_only) {
  const std::vector<std::byte> scene = read(order.scene), sky = read(order.environment);
  if (scene.empty()) {
    std::printf("%-14s left out: %s is not here\n", order.name, order.scene);
    return;
  }
  const std::string scene_digest = "sha256:" + std::string(64, 'a');
  const std::string sky_digest = "sha256:" + std::string(64, 'b');
  Inputs inputs;
  inputs.blobs[scene_digest] = scene;
  inputs.blobs[sky_digest] = sky;
  ProbesParameters parameters;
  parameters.positions = order.positions;
  parameters.cubemap.size = smoke ? 4 : order.size;
  Spec spec;
  spec.scene = InputRef{scene_digest, {}};
  if (!sky.empty()) spec.environment = InputRef{sky_digest, {}};
  spec.parameters = parameters;
  spec.accuracy.target_error = smoke ? 1 : order.target_error;
  Progress progress;
  Bake bake(spec, inputs, {});
  const double wall = wall_seconds(), cpu = process_cpu_seconds();
  const Plan plan = bake.plan(progress);
  const double cpu_per_wall = (process_cpu_seconds() - cpu) / (wall_seconds() - wall);
  if (plan_only) {
    for (const Price& price : plan.prices) {
      std::printf("%-14s %5.2f  %6.3f %9.2f s, %llu samples a texel%s\n", order.name, plan.pilot_s,
                  price.error, price.seconds, static_cast<unsigned long long>(price.samples),
                  price.extrapolated ? ", extrapolated" : "");
    }
    return;
  }
  std::vector<ChunkResult> chunks;
  for (const ElementRange& range : plan.chunks) {
    chunks.push_back(bake.chunk(plan, range, progress));
  }
  const AccuracyRecord record = bake.assemble(plan, chunks, progress).accuracy;
  const uint64_t samples = record.rounds.empty() ? 0 : record.rounds.back().samples;
  std::printf("%-14s %5.2f %9.2f %8.2f %6.2f %9.2f %8.2f %6.2f  %6.3f %8.4f %7llu %s\n", order.name,
              plan.pilot_s, plan.predicted_s, record.actual_s, plan.predicted_s / record.actual_s,
              plan.predicted_s * cpu_per_wall, record.cpu_s,
              plan.predicted_s * cpu_per_wall / record.cpu_s, record.target_error, record.error_rms,
              static_cast<unsigned long long>(samples), accuracy_status_name(record.status));
  std::fflush(stdout);
}

}  // namespace
}  // namespace lightkiln

int main(int argc, char** argv) {
  bool smoke = false, plan_only = false;
  std::vector<std::string> names;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--smoke") == 0) {
      smoke = true;
    } else if (std::strcmp(argv[i], "--plan") == 0) {
      plan_only = true;
    } else {
      names.emplace_back(argv[i]);
    }
  }
  std::printf(
      "                        wall seconds               cpu seconds\n"
      "scene          pilot predicted   actual  ratio predicted   actual  ratio  target    error "
      "samples status\n");
  for (const lightkiln::Case& one : lightkiln::cases()) {
    if (smoke && std::strcmp(one.name, "demo") != 0) continue;
    if (!names.empty() && std::find(names.begin(), names.end(), one.name) == names.end()) continue;
    try {
      lightkiln::run(one, smoke, plan_only);
    } catch (const lightkiln::Error& error) {
      std::fprintf(stderr, "%s: %s\n", one.name, error.what());
      return 1;
    }
  }
  return 0;
}
