#include <algorithm>
#include <bit>
#include <cmath>

#include "core/bake/maps_cost.h"
#include "core/bake/probe_pilot.h"
#include "core/bake/probe_price.h"
#include "core/bake/probes_state.h"
#include "core/bake/window_report.h"
#include "core/base/parallel.h"

namespace lightkiln {

namespace {

constexpr uint64_t kFewestSamples = uint64_t{kFirstSamples} * 16;
// Small cubes take more samples a texel, so that their harmonics still rest on enough paths.
constexpr uint64_t kFewestPaths = 1 << 15;

uint64_t fewest_samples(int size) {
  const auto texels = static_cast<uint64_t>(6 * size * size);
  return std::max(kFewestSamples, std::bit_ceil(kFewestPaths / texels));
}

void take_effects(EffectPlan&& decided, Plan* plan) {
  for (EffectReason& effect : decided.reasons) {
    plan->effects.push_back(
        {std::move(effect.name), effect.active, std::move(effect.reason), effect.bound});
  }
  plan->warnings.insert(plan->warnings.end(), decided.warnings.begin(), decided.warnings.end());
  plan->max_bounces = decided.selection.max_bounces;
  plan->bias_bound = decided.bias_bound;
}

// Rays of a texel: a texel is what a probe's samples are counted by.
uint64_t most_samples(const ProbesState& state, const Plan& plan) {
  const double rays_each = 1 + 3 * (plan.max_bounces + 1.0);
  const double allowed = static_cast<double>(kMostRaysPerElement) / rays_each;
  const auto affordable = std::bit_floor(static_cast<uint64_t>(std::max(allowed, 1.0)));
  return std::max(kFewestSamples, std::min(max_samples(state.spec), affordable));
}

// The largest power of two that the seconds pay for.
uint64_t samples_within(const std::vector<ProbePilot>& pilots, double seconds, const Plan& plan) {
  uint64_t samples = plan.max_samples;
  const double target = 0;  // no rule ends it earlier
  while (samples > kFewestSamples &&
         forecast(pilots, plan.elements, target, samples, samples).seconds.value > seconds) {
    samples /= 2;
  }
  return samples;
}

// What no sample changes: the windows of all probes.
double fixed_seconds(const ProbesState& state, const Plan& plan) {
  const ProbeShOutput& sh = state.parameters().sh;
  if (sh.window == ShWindow::none) return 0;
  return static_cast<double>(plan.elements) * window_seconds(sh.window, sh.bands) *
         measure_speed() / granted_threads(state.grants.threads);
}

void price(const ProbesState& state, const std::vector<ProbePilot>& pilots, Plan* plan) {
  const double fixed = fixed_seconds(state, *plan);
  if (const auto limit = state.spec.accuracy.max_seconds) {
    plan->max_samples = samples_within(pilots, *limit - fixed, *plan);
    plan->min_samples = std::min(plan->min_samples, plan->max_samples);
    const uint64_t least = plan->min_samples;
    if (fixed + forecast(pilots, plan->elements, 0, least, least).seconds.value > *limit) {
      plan->warnings.push_back("Even " + std::to_string(least) +
                               " samples a texel, the fewest, may take longer than max_seconds "
                               "allows.");
    }
  }
  const Forecast order = forecast(pilots, plan->elements, noise_target(state, *plan),
                                  plan->min_samples, plan->max_samples);
  plan->predicted_s = fixed + order.seconds.value;
  plan->predicted_low_s = fixed + order.seconds.low;
  plan->predicted_high_s = fixed + order.seconds.high;
  for (const double error : kQuotedErrors) {
    // No limit of samples: a price says what the error needs.
    const Forecast quoted =
        forecast(pilots, plan->elements, error, plan->min_samples, uint64_t{1} << 40);
    plan->prices.push_back({error, static_cast<uint64_t>(std::ceil(quoted.samples)),
                            fixed + quoted.seconds.value, quoted.extrapolated});
  }
}

}  // namespace

Plan probes_plan(ProbesState& state, Progress& progress) {
  const FlushDenormals guard;
  const double start = wall_seconds();
  Plan plan;
  plan.kind = Kind::probes;
  plan.isa = state.tracer->isa();
  plan.elements = state.parameters().positions.size();
  plan.element_unit = "probe";
  add_scene_report(state.scene.report, &plan);
  plan.warnings.insert(plan.warnings.end(), state.warnings.begin(), state.warnings.end());
  if (state.environment) {
    const PixelRepairs& repairs = state.environment->repairs;
    if (repairs.nan > 0) plan.repairs.emplace_back("environment_nan_values", repairs.nan);
    if (repairs.infinite > 0) {
      plan.repairs.emplace_back("environment_infinite_values", repairs.infinite);
    }
    if (repairs.negative > 0) {
      plan.repairs.emplace_back("environment_negative_values", repairs.negative);
    }
  }

  const std::vector<uint64_t> probes = pilot_probes(state);
  const double found = pilot_luminance(state, probes, progress);
  plan.reference_luminance = found > 0 ? found : 1;
  if (!(found > 0)) {
    plan.warnings.push_back(
        "No light reaches the pilot's probes, so errors are absolute instead of relative to the "
        "mean luminance.");
  }
  take_effects(decide_effects(state.survey, state.order(found)), &plan);
  plan.max_samples = most_samples(state, plan);
  plan.min_samples = std::min(plan.max_samples, fewest_samples(state.parameters().cubemap.size));

  price(state, pilot_rounds(state, plan, probes, progress), &plan);
  plan.chunks = split_chunks(plan.elements, plan.predicted_s, state.grants.chunk_seconds);
  plan.pilot_s = wall_seconds() - start;
  return plan;
}

}  // namespace lightkiln
