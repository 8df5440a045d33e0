#include <algorithm>
#include <bit>
#include <cmath>

#include "core/bake/probe_pilot.h"
#include "core/bake/probes_state.h"
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

// Error c N^-beta through the pilot's rounds and time b N, as prices are quoted.
class Prediction {
 public:
  explicit Prediction(const std::vector<Round>& rounds, uint64_t elements) {
    double seconds = 0;
    for (const Round& round : rounds) seconds += round.wall_s;
    samples_ = static_cast<double>(rounds.back().samples);
    seconds_per_sample_ = seconds / samples_;
    const auto rms = [&](const Round& round) {
      return std::sqrt(round.error_sum_sq / static_cast<double>(elements));
    };
    error_ = rms(rounds.back());
    const double first = rms(rounds.front());
    const double ratio = samples_ / static_cast<double>(rounds.front().samples);
    if (first > 0 && error_ > 0) {
      beta_ = std::clamp(std::log(first / error_) / std::log(ratio), 0.5, 1.5);
    }
  }
  double error(uint64_t samples) const {
    return error_ * std::pow(samples_ / static_cast<double>(samples), beta_);
  }
  // Where the stopping rule's doublings from `fewest` end.
  uint64_t samples_for(double target, uint64_t fewest, uint64_t most) const {
    uint64_t samples = fewest;
    for (int look = 1; 2 * samples <= most; ++look, samples *= 2) {
      if (error(samples) * look_widening(look) <= target) break;
    }
    return samples;
  }
  double seconds(uint64_t samples) const {
    return seconds_per_sample_ * static_cast<double>(samples);
  }
  // The largest power of two that the seconds pay for.
  uint64_t samples_within(double seconds) const {
    const double affordable = seconds / std::max(seconds_per_sample_, 1e-12);
    return std::bit_floor(static_cast<uint64_t>(std::clamp(affordable, 1.0, 0x1p40)));
  }

 private:
  double samples_ = 0, seconds_per_sample_ = 0, error_ = 0, beta_ = 0.5;
};

void take_effects(EffectPlan&& decided, Plan* plan) {
  for (EffectReason& effect : decided.reasons) {
    plan->effects.push_back(
        {std::move(effect.name), effect.active, std::move(effect.reason), effect.bound});
  }
  plan->warnings.insert(plan->warnings.end(), decided.warnings.begin(), decided.warnings.end());
  plan->max_bounces = decided.selection.max_bounces;
}

// The grant counts rays of a texel here: a texel is what a probe's samples are counted by.
uint64_t most_samples(const ProbesState& state, const Plan& plan) {
  const double rays_each = 1 + 3 * (plan.max_bounces + 1.0);
  const double granted = static_cast<double>(state.grants.max_rays_per_element) / rays_each;
  const auto affordable = std::bit_floor(static_cast<uint64_t>(std::max(granted, 1.0)));
  return std::max(kFewestSamples, std::min(max_samples(state.spec), affordable));
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

  const std::vector<Round> rounds = pilot_rounds(state, plan, probes, progress);
  plan.prices = price_errors(rounds, plan.elements);
  const Prediction prediction(rounds, plan.elements);
  if (state.spec.accuracy.max_seconds) {
    plan.max_samples = std::clamp(prediction.samples_within(*state.spec.accuracy.max_seconds),
                                  kFewestSamples, plan.max_samples);
    plan.min_samples = std::min(plan.min_samples, plan.max_samples);
    if (prediction.seconds(plan.min_samples) > *state.spec.accuracy.max_seconds) {
      plan.warnings.push_back("Even " + std::to_string(plan.min_samples) +
                              " samples a texel, the fewest, may take longer than max_seconds "
                              "allows.");
    }
  }
  const uint64_t samples =
      prediction.samples_for(target_error(state.spec), plan.min_samples, plan.max_samples);
  plan.predicted_s = prediction.seconds(samples);
  plan.chunks = split_chunks(plan.elements, plan.predicted_s, state.grants.chunk_seconds);
  plan.pilot_s = wall_seconds() - start;
  return plan;
}

}  // namespace lightkiln
