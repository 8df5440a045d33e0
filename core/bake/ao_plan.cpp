// The plan of an ambient-occlusion job: which effects its rays need, and what each error costs.

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>

#include "core/bake/ao_state.h"
#include "core/bake/error_curve.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/base/text.h"
#include "core/trace/texture.h"

namespace lightkiln {

namespace {

constexpr uint64_t kFirstSamples = 256;  // 16 replicates of 16 points
constexpr int kPilotRounds = 4;          // 256, 512, 1024 and 2048 samples
// Of openness where shadows have edges, for want of anything seen.
constexpr double kUnknownSlope = 0.75;
constexpr uint64_t kPilotGroups = 64;
constexpr uint64_t kPilotGroupSize = 8;

// Runs of neighbouring vertices from all over the scene: a random sample of the work, read from
// memory in the order in which the bake will read it. Ascending, without repeats.
std::vector<uint64_t> pilot_vertices(uint64_t vertices, uint64_t seed) {
  std::set<uint64_t> chosen;
  if (vertices <= kPilotGroups * kPilotGroupSize) {
    for (uint64_t v = 0; v < vertices; ++v) chosen.insert(v);
  } else {
    // One group in each of equal stretches, at a random place.
    const uint64_t stretch = vertices / kPilotGroups;
    for (uint64_t g = 0; g < kPilotGroups; ++g) {
      const uint64_t first = g * stretch + hash_combine(seed, g) % (stretch - kPilotGroupSize + 1);
      for (uint64_t i = 0; i < kPilotGroupSize; ++i) chosen.insert(first + i);
    }
  }
  return {chosen.begin(), chosen.end()};
}

// What the pilot saw: each element's standard error after each round, how errors fall past the last
// round, and what a ray takes.
struct Pilot {
  std::vector<std::vector<double>> errors;  // [round][element]
  size_t elements = 0;
  double slope = kUnknownSlope;
  double seconds_per_ray = 0;
  double seconds = 0;
};

// Root sum of squares over elements, after each round.
std::vector<double> sums_of_rounds(const std::vector<std::vector<double>>& errors) {
  std::vector<double> sums;
  for (const auto& round : errors) {
    double sum = 0;
    for (const double error : round) sum += error * error;
    sums.push_back(std::sqrt(sum));
  }
  return sums;
}

Pilot run_pilot(const AoState& state, OpennessParameters parameters, Progress& progress) {
  const double start_s = wall_seconds();
  Pilot pilot;
  const std::vector<uint64_t> ids = pilot_vertices(state.facets->vertices(), state.spec.seed);
  pilot.elements = ids.size();
  if (ids.empty()) return pilot;
  parameters.target_error = 0;
  parameters.min_samples = kFirstSamples;
  parameters.max_samples = kFirstSamples << (kPilotRounds - 1);
  const OpennessKernel kernel(*state.tracer, parameters);
  const OpennessBatch batch = estimate_vertices(state, kernel, ids, true, progress);
  pilot.errors = batch.history;
  pilot.slope = fitted_slope(sums_of_rounds(batch.history), kUnknownSlope);
  uint64_t rays = 0;
  for (const Round& round : batch.report.rounds) rays += round.rays;
  pilot.seconds = wall_seconds() - start_s;
  if (rays > 0) pilot.seconds_per_ray = batch.report.wall_s / static_cast<double>(rays);
  return pilot;
}

struct Spending {
  double mean_samples = 0;    // of all elements, those without rays included
  double doubt = 0;           // half of a 90 % interval of that mean
  bool extrapolated = false;  // some element needs more rounds than the pilot ran
};

// What the stopping rule spends on an element for `target`, at most `cap` samples each.
Spending spend(const Pilot& pilot, double target, uint64_t cap) {
  Spending spending;
  RunningMoments samples;
  for (size_t e = 0; e < pilot.elements; ++e) {
    // Only elements without rays have no error at all.
    if (pilot.errors.empty() || pilot.errors[0][e] == 0) {
      samples.add(0);
      continue;
    }
    ErrorCurve curve{kFirstSamples, {}, pilot.slope};
    for (const std::vector<double>& round : pilot.errors) curve.errors.push_back(round[e]);
    const Stop stop = stop_of(curve, look_quantile, target, kFirstSamples, cap);
    spending.extrapolated |= stop.extrapolated;
    samples.add(static_cast<double>(std::min(stop.samples, cap)));
  }
  spending.mean_samples = samples.mean;
  // Neighbours are alike, so a group counts as two elements.
  const double independent = 2 * static_cast<double>(pilot.elements) / kPilotGroupSize;
  if (independent > 1) spending.doubt = 1.645 * std::sqrt(samples.variance() / independent);
  return spending;
}

double predict_seconds(const Pilot& pilot, uint64_t elements, double target, uint64_t cap) {
  return spend(pilot, target, cap).mean_samples * static_cast<double>(elements) *
         pilot.seconds_per_ray;
}

// The largest sample count whose predicted time keeps the promise; never below 64.
uint64_t samples_in_time(const Pilot& pilot, uint64_t elements, double target, uint64_t most,
                         double max_seconds) {
  uint64_t samples = most;
  while (samples > 64 && predict_seconds(pilot, elements, target, samples) > max_seconds)
    samples /= 2;
  return samples;
}

// The most that the falloff can add to an openness: the integral of mu over the hits is at most the
// largest mu of a hit. Every falloff grows with distance, and no hit is farther than the scene is
// long or rays reach.
double largest_falloff(const AoState& state) {
  const OpennessParameters p = openness_parameters(state);
  const double farthest = std::min(length(state.scene.bounds.extent()), p.max_distance);
  return std::min(1.0, falloff_weight(p, farthest));
}

Effect hit_distance_effect(const AoState& state) {
  const bool active = state.parameters().falloff != Falloff::none;
  return {"nearest_hit_distance", active,
          active ? "The falloff weighs each hit by its distance, so rays look for the nearest hit."
                 : "Without a falloff a hit counts fully at any distance: rays end at the first "
                   "hit they find.",
          active ? largest_falloff(state) : 0.0};
}

Effect max_distance_effect(const AoState& state) {
  const AmbientOcclusionParameters& p = state.parameters();
  const double world = length(state.scene.bounds.extent()) / state.scene.normalisation.scale();
  if (!p.max_distance)
    return {"max_distance", false,
            "No max_distance is ordered: rays reach to the end of the scene.", 0};
  const bool active = openness_parameters(state).max_distance != INFINITY;
  if (!active)
    return {"max_distance", false,
            "The scene's diagonal is " + short_number(world) + ", so nothing lies beyond " +
                short_number(*p.max_distance) + ".",
            0};
  return {"max_distance", true,
          "Surfaces farther than " + short_number(*p.max_distance) + " count as open sky.", 1};
}

Effect certificate_effect(const OpennessKernel& kernel) {
  const bool active = kernel.reach() != INFINITY;
  return {"open_certificates", active,
          active ? "Vertices with nothing above their planes within reach are 1 without a ray."
                 : "Rays reach to the end of the scene: only a ray can tell that nothing is hit.",
          0};
}

Effect falloff_effect(const AoState& state, const OpennessKernel& kernel) {
  const AmbientOcclusionParameters& p = state.parameters();
  if (p.falloff == Falloff::none)
    return {"falloff", false, "The falloff is none: occlusion is a yes or no.", 0};
  std::string reason = "A hit counts the less, the farther it lies.";
  if (p.falloff == Falloff::exponential)
    reason += " Rays end at " + short_number(kernel.reach() / state.scene.normalisation.scale()) +
              ", past which a hit could change the result by less than 6e-8.";
  return {"falloff", true, reason, largest_falloff(state)};
}

void add_alpha_effects(const AoState& state, Plan* plan) {
  size_t masked = 0;
  size_t textured = 0;
  for (const SurfaceMesh& mesh : state.scene.meshes) {
    if (!needs_alpha_test(state.scene, mesh)) continue;
    ++masked;
    const Material& material = state.scene.materials[static_cast<size_t>(mesh.material)];
    textured += material.base_color_texture.texture >= 0;
  }
  plan->effects.push_back(
      {"alpha_test", masked > 0,
       masked > 0 ? std::to_string(masked) + " meshes have points below their alpha cutoff."
                  : "No surface has a point below an alpha cutoff.",
       masked > 0 ? 1.0 : 0.0});
  plan->effects.push_back({"textures", textured > 0,
                           textured > 0 ? "Only the alpha of masked materials is read."
                                        : "Openness depends on no texture: none is decoded.",
                           textured > 0 ? 1.0 : 0.0});
  for (const Material& material : state.scene.materials)
    if (material.alpha_mode == AlphaMode::blend) {
      plan->warnings.push_back("Surfaces with alphaMode BLEND occlude as if they were opaque.");
      break;
    }
}

void add_effects(const AoState& state, const OpennessKernel& kernel, Plan* plan) {
  plan->effects = {hit_distance_effect(state), max_distance_effect(state),
                   falloff_effect(state, kernel), certificate_effect(kernel)};
  add_alpha_effects(state, plan);
  for (const char* name : {"environment", "environment_variation", "emissive_surfaces",
                           "punctual_lights", "diffuse_bounces"})
    plan->effects.push_back({name, false, "Openness is geometry alone and knows no light.", 0});
}

void price(const AoState& state, const Pilot& pilot, Plan* plan) {
  const uint64_t most = max_samples(state.spec);
  const double target = target_error(state.spec);
  plan->max_samples = most;
  if (const auto limit = state.spec.accuracy.max_seconds) {
    plan->max_samples = samples_in_time(pilot, plan->elements, target, most, *limit);
    if (predict_seconds(pilot, plan->elements, target, plan->max_samples) > *limit)
      plan->warnings.push_back("Even 64 samples a vertex may take longer than the " +
                               short_number(*limit) + " seconds that max_seconds allows.");
  }
  plan->min_samples = std::min(kFirstSamples, plan->max_samples);
  const Spending order = spend(pilot, target, plan->max_samples);
  const double seconds_per_sample = static_cast<double>(plan->elements) * pilot.seconds_per_ray;
  plan->predicted_s = order.mean_samples * seconds_per_sample;
  // All elements in the pilot leave no doubt.
  const double doubt = plan->elements > pilot.elements ? order.doubt : 0;
  plan->predicted_low_s = std::max(0.0, order.mean_samples - doubt) * seconds_per_sample;
  plan->predicted_high_s = (order.mean_samples + doubt) * seconds_per_sample;
  const auto elements = static_cast<double>(plan->elements);
  for (const double error : kQuotedErrors) {
    // No limit of samples: a price says what the error needs.
    const Spending spending = spend(pilot, error, uint64_t{1} << 40);
    plan->prices.push_back({error, static_cast<uint64_t>(std::ceil(spending.mean_samples)),
                            spending.mean_samples * elements * pilot.seconds_per_ray,
                            spending.extrapolated});
  }
}

}  // namespace

Plan ao_plan(AoState& state, Progress& progress) {
  Plan plan;
  plan.kind = Kind::ambient_occlusion;
  plan.isa = state.tracer->isa();
  plan.elements = state.facets->vertices();
  plan.element_unit = "vertex";
  plan.reference_luminance = 1;
  add_scene_report(state.scene.report, &plan);
  if (state.facets->unused_vertices() > 0)
    plan.repairs.emplace_back("vertices_of_no_triangle", state.facets->unused_vertices());
  const OpennessParameters parameters = openness_parameters(state);
  add_effects(state, OpennessKernel(*state.tracer, parameters), &plan);
  const Pilot pilot = run_pilot(state, parameters, progress);
  plan.pilot_s = pilot.seconds;
  price(state, pilot, &plan);
  plan.chunks = split_chunks(plan.elements, plan.predicted_s, state.grants.chunk_seconds);
  return plan;
}

}  // namespace lightkiln
