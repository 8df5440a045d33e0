#include "core/bake/probe_pilot.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/random.h"

namespace lightkiln {

namespace {

constexpr uint64_t kPilotProbes = 4;
constexpr uint64_t kCandidates = 64;
constexpr uint32_t kReferencePaths = 1024;  // a replicate; rounds of the path sampler end here
constexpr size_t kPathsPerBlock = 256;
// Deep enough that the mean albedo leaves a hundredth.
constexpr double kPilotRest = 0.01;

int pilot_bounces(const LightSurvey& survey) {
  if (!(survey.mean_albedo > 0)) return survey.max_albedo > 0 ? 2 : 0;
  const double bounces = std::log(kPilotRest) / std::log(std::min(survey.mean_albedo, 0.99));
  return static_cast<int>(std::clamp(std::ceil(bounces), 2.0, double{kMostBounces}));
}

// The mean luminance that one path and one search for each kind of direct light tell: all count
// alike, at the paths' uniform density.
double reference_sample(const RadianceScene& scene, const Vec3& origin, const Vec3& direction,
                        uint64_t key, uint32_t index, RayCounters& counters) {
  constexpr auto kDensity = static_cast<float>(1 / (4 * kPi));
  const auto density = [](const Vec3&) { return kDensity; };
  const auto set = [&](DimensionSet name) {
    return hash_combine(key, static_cast<uint64_t>(name));
  };
  Vec3 sum = scene.sample({origin, direction}, key, index, counters, kDensity);
  for (const Sight sight : kSights) {
    if (!scene.has(sight)) continue;
    const Point4 u = sobol4(set(dimensions_of(sight)), index);
    sum += scene.look(sight, origin, u, density, counters).radiance;
  }
  return luminance(to_double(sum));
}

}  // namespace

std::vector<uint64_t> pilot_probes(const ProbesState& state) {
  const uint64_t count = state.parameters().positions.size();
  const uint64_t candidates = std::min(count, kCandidates);
  std::vector<uint64_t> free, taken;
  for (uint64_t i = 0; i < candidates; ++i) {
    const uint64_t probe = count * i / candidates;
    RayCounters counters;
    const ProbeSurroundings found = probe_surroundings(*state.tracer, state.origin(probe),
                                                       state.key(kPilotStream, probe), counters);
    (found.status == ProbeStatus::valid ? free : taken).push_back(probe);
  }
  const std::vector<uint64_t>& from = free.empty() ? taken : free;
  const uint64_t wanted = std::min<uint64_t>(kPilotProbes, from.size());
  std::vector<uint64_t> chosen;
  for (uint64_t i = 0; i < wanted; ++i) chosen.push_back(from[from.size() * i / wanted]);
  return chosen;
}

double pilot_luminance(ProbesState& state, const std::vector<uint64_t>& probes,
                       Progress& progress) {
  EffectOrder order = state.order(0);
  if (!order.max_bounces) order.max_bounces = pilot_bounces(state.survey);
  const RadianceScene& scene = state.radiance_for(decide_effects(state.survey, order).selection);
  const size_t each = static_cast<size_t>(kReplicates) * kReferencePaths;
  const size_t count = probes.size() * each;
  std::vector<double> sums((count + kPathsPerBlock - 1) / kPathsPerBlock);
  parallel_blocks(
      count, kPathsPerBlock, state.grants.threads, progress,
      [&](size_t begin, size_t end) {
        RayCounters counters;
        double sum = 0;
        for (size_t i = begin; i < end; ++i) {
          const uint64_t probe = probes[i / each];
          const uint64_t key =
              hash_combine(state.key(kPilotStream, probe), i % each / kReferencePaths);
          const auto index = static_cast<uint32_t>(i % kReferencePaths);
          const Point2 u =
              sobol2(hash_combine(key, static_cast<uint64_t>(DimensionSet::probe_pilot)), index);
          sum += reference_sample(scene, state.origin(probe), uniform_direction(u), key, index,
                                  counters);
        }
        sums[begin / kPathsPerBlock] = sum;
      },
      0, 0.3);
  return std::accumulate(sums.begin(), sums.end(), 0.0) / static_cast<double>(count);
}

}  // namespace lightkiln
