#include <algorithm>
#include <cmath>

#include "core/bake/probe_cube.h"
#include "core/bake/probes_state.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/image/decode.h"
#include "core/sphere/harmonic_transform.h"

namespace lightkiln {

void ProbesStateDeleter::operator()(ProbesState* state) const {
  delete state;
}

std::unique_ptr<ProbesState, ProbesStateDeleter> probes_open(const Spec& spec, const Inputs& inputs,
                                                             const Grants& grants) {
  std::unique_ptr<ProbesState, ProbesStateDeleter> state(new ProbesState);
  state->spec = spec;
  state->grants = grants;
  state->scene = load_gltf(gltf_source(*spec.scene, inputs), {});
  if (spec.environment) {
    const ProbesParameters& parameters = state->parameters();
    DecodedImage decoded = decode_environment(*spec.environment, inputs);
    state->warnings = source_warnings(*spec.environment, inputs, parameters.source, decoded);
    state->environment = make_environment(std::move(decoded),
                                          environment_reading(*spec.environment, parameters.source),
                                          rotation_of(parameters.rotation), grants.threads);
  }
  state->survey = survey_light(state->scene, state->light());
  TracerOptions options;
  options.build_threads = grants.threads;
  options.max_memory_bytes = grants.max_memory_bytes;
  options.alpha_test = state->survey.alpha_tested;
  state->tracer = std::make_unique<Tracer>(state->scene, options);
  return state;
}

uint64_t ProbesState::key(uint64_t stream, uint64_t probe) const {
  return hash_combine(hash_combine(spec.seed, stream), probe);
}

const RadianceScene& ProbesState::radiance_for(const EffectSelection& selection) {
  if (!radiance || !(radiance->selection() == selection)) {
    radiance = std::make_unique<RadianceScene>(*tracer, light(), survey, selection);
  }
  return *radiance;
}

EffectSelection plan_selection(const ProbesState& state, const Plan& plan) {
  std::vector<EffectReason> reasons;
  for (const Effect& effect : plan.effects) {
    reasons.push_back({effect.name, effect.active, effect.reason, effect.bound});
  }
  return selection_of(reasons, plan.max_bounces, state.survey,
                      state.order(plan.reference_luminance));
}

double noise_target(const ProbesState& state, const Plan& plan) {
  const double target = target_error(state.spec);
  return plan.bias_bound <= kBiasShare * target ? target - plan.bias_bound : target;
}

namespace {

// Progress inside one probe, whose number of rounds is not known beforehand: the share of samples
// taken that the error so far suggests, error falling like N^(-2/3).
double share_done(double error, double target) {
  return error > target ? std::pow(target / error, 1.5) : 1;
}

// Around a scene without triangles there is the environment alone, whose harmonics are known but
// for the rounding of quadrature.
constexpr double kProjectionTolerance = 1e-9;
ShRgb environment_harmonics(const Environment& environment, int bands, int threads,
                            Progress& progress) {
  const std::vector<double> weights(static_cast<size_t>(bands), 1.0);
  const int points = row_gauss_points(environment.radiance.height, weights, kProjectionTolerance);
  return world_harmonics(project_latlong(environment.radiance, bands, points, threads, progress),
                         bands);
}

void apply_window(const ProbeShOutput& order, int threads, ProbeResult* result) {
  Progress quiet;
  WindowedSh windowed = window_sh(result->sh, order.window, order.window_quantity, threads, quiet);
  result->sh = std::move(windowed.sh);
  result->window = std::move(windowed.report);
}

// Doubles until the error is ordered, or the samples are spent.
ProbeResult bake_probe(ProbesState& state, const RadianceScene& scene, const CubeTexels& texels,
                       const Plan& plan, uint64_t probe, Progress& progress, double progress_begin,
                       double progress_width, ChunkReport* report) {
  const ProbesParameters& parameters = state.parameters();
  const double target = noise_target(state, plan);
  const double wall = wall_seconds(), cpu = process_cpu_seconds();
  const Vec3 origin = state.origin(probe);
  const uint64_t key = state.key(kBakeStream, probe);

  ProbeResult result;
  result.index = probe;
  result.surroundings = probe_surroundings(*state.tracer, origin, key, report->counters);
  result.distance =
      probe_distances(*state.tracer, origin, parameters.cubemap.size, report->counters);

  CubeSampling sampling(scene, texels, origin, key, parameters.sh.bands, state.grants.threads);
  double done = 0;
  bool reached = false;
  do {
    const double next = 0.5 * (1 + done);
    Round round = sampling.advance(progress, progress_begin + progress_width * done,
                                   progress_begin + progress_width * next);
    // As exact as a float: the quantile's last bits depend on the C library.
    const double bound = sampling.error().bound(kLookConfidence) / plan.reference_luminance;
    result.error = static_cast<double>(static_cast<float>(bound));
    round.error_sum_sq = result.error * result.error;
    round.error_max = result.error;
    reached = result.error <= target;
    round.converged = reached ? 1 : 0;
    report->rounds.push_back(round);
    done = std::max(next, share_done(result.error, target));
  } while (sampling.samples() < plan.min_samples ||
           (!reached && 2 * sampling.samples() <= plan.max_samples));

  const bool suspicious = sampling.suspicious(), limited = !reached;
  result.accuracy = suspicious ? AccuracyStatus::suspicious
                    : limited  ? AccuracyStatus::budget_limited
                               : AccuracyStatus::converged;
  result.samples = sampling.samples();
  if (state.scene.bounds.empty() && scene.selection().environment) {
    Progress quiet;
    result.sh =
        environment_harmonics(*state.light(), parameters.sh.bands, state.grants.threads, quiet);
    result.sh_error = kProjectionTolerance;
  } else {
    result.sh = sampling.harmonics();
    result.sh_error = static_cast<double>(static_cast<float>(sampling.harmonics_error()));
  }
  apply_window(parameters.sh, state.grants.threads, &result);
  for (size_t i = 0; i < texels.texels.size(); ++i) {
    const Vec3 rgb = sampling.texel(i);
    result.radiance.insert(result.radiance.end(), {rgb.x, rgb.y, rgb.z});
  }
  report->elements = 1;
  report->suspicious = suspicious;
  report->budget_limited = limited;
  report->counters += sampling.counters();
  report->cpu_s = process_cpu_seconds() - cpu;
  report->wall_s = wall_seconds() - wall;
  return result;
}

ChunkReport merge_reports(const std::vector<ChunkReport>& probes, double target) {
  const AccuracyRecord record = summarise_accuracy(probes, target, 0, "");
  ChunkReport report;
  report.elements = record.elements;
  report.rounds = record.rounds;
  report.counters = record.counters;
  report.cpu_s = record.cpu_s;
  report.wall_s = record.actual_s;
  report.suspicious = record.suspicious;
  report.budget_limited = record.budget_limited;
  return report;
}

}  // namespace

ChunkResult probes_chunk(ProbesState& state, const Plan& plan, const ElementRange& range,
                         Progress& progress) {
  const FlushDenormals guard;
  const RadianceScene& scene = state.radiance_for(plan_selection(state, plan));
  const CubeTexels texels = all_texels(state.parameters().cubemap.size);
  ByteWriter writer;
  std::vector<ChunkReport> reports;
  for (uint64_t i = 0; i < range.count; ++i) {
    const double width = 1 / static_cast<double>(range.count);
    reports.emplace_back();
    write_probe(bake_probe(state, scene, texels, plan, range.first + i, progress,
                           static_cast<double>(i) * width, width, &reports.back()),
                writer);
  }
  return {writer.take(), merge_reports(reports, target_error(state.spec))};
}

}  // namespace lightkiln
