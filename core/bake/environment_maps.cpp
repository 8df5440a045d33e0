// Environment maps: every product is made only when ordered. An element is an output; a chunk's
// bytes are its outputs' values in order, then what was measured of the error of each.

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/image/decode.h"
#include "core/sphere/row_spectra.h"

namespace lightkiln {

struct EnvironmentMapsState {
  Spec spec;
  Grants grants;
  std::string format;
  std::vector<std::string> warnings;  // of the input
  MapsLight light;
  MapsOutputs outputs;

  const EnvironmentMapsParameters& parameters() const {
    return std::get<EnvironmentMapsParameters>(spec.parameters);
  }
  double target() const { return target_error(spec); }
};

void EnvironmentMapsStateDeleter::operator()(EnvironmentMapsState* state) const {
  delete state;
}

namespace {

int bands_of(const MapsOutputs& outputs) {
  int bands = sh_need_of(outputs).bands;
  for (const LobePlan& lobe : lobes_of(outputs)) bands = std::max(bands, lobe.bands);
  return bands;
}

// Another layout is brought to a lat-long to a tenth of the order, as long as that takes seconds.
SourceReading reading_for(const Spec& spec, const SourceParameters& parameters) {
  constexpr double kFinest = 1e-5;
  SourceReading reading = environment_reading(*spec.environment, parameters);
  reading.conversion_error = std::clamp(0.1 * target_error(spec), kFinest, kConversionError);
  return reading;
}

}  // namespace

std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> environment_maps_open(
    const Spec& spec, const Inputs& inputs, const Grants& grants) {
  const auto& parameters = std::get<EnvironmentMapsParameters>(spec.parameters);
  DecodedImage decoded = decode_environment(spec.environment.value(), inputs);
  std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> state(new EnvironmentMapsState{
      spec,
      grants,
      decoded.format,
      source_warnings(*spec.environment, inputs, parameters.source, decoded),
      MapsLight(make_pending_environment(std::move(decoded), reading_for(spec, parameters.source),
                                         rotation_of(parameters.rotation), grants.threads),
                grants.threads, sun_options(parameters)),
      {}});
  state->outputs =
      order_outputs(state->parameters(), state->light, working_target(state->target()));
  require_spectrum(state->outputs, &state->light);
  return state;
}

namespace {

Effect variation_effect(EnvironmentMapsState& state) {
  if (state.light.constant()) {
    return {"environment_variation", false,
            "Every texel is equal: all outputs of its radiance are that value in closed form.", 0};
  }
  for (const MapsProduct& product : maps_products()) {
    if (!product.depends_on_light || !product.ordered(state.parameters())) continue;
    const double spread = state.light.statistics().spread;
    return {"environment_variation", true,
            "Radiance varies over the map: its standard deviation is " + short_number(spread) +
                " of its mean.",
            spread};
  }
  return {"environment_variation", false, "No output that depends on the light is ordered.", 0};
}

Effect bright_effect(EnvironmentMapsState& state) {
  double bound = 0;
  bool active = false;
  for (const LobePlan& lobe : lobes_of(state.outputs)) {
    if (!lobe.corrected) continue;
    active = true;
    bound = std::max(bound, lobe.uncorrected_bound);
  }
  if (!active) {
    return {"bright_texels", false,
            "No texel is so bright that the band limits of this order would show.", 0};
  }
  const LightStatistics& light = state.light.statistics();
  return {"bright_texels", true,
          std::to_string(light.bright.size()) + " texels hold " +
              short_number(100 * light.bright_share) +
              " % of the light: what the band limits cut off them is added in closed form.",
          bound};
}

Effect convention_effect(const EnvironmentMapsState& state) {
  const Environment& environment = state.light.environment();
  if (environment.source_layout.convention == TexelConvention::openexr) {
    return {"border_texels", true,
            std::string("The file's outer pixel centres lie on the borders (OpenEXR's envmap "
                        "convention): it ") +
                "is resampled, twice as fine, to centres at (i + 1/2)/N, to " +
                short_number(environment.conversion_error) +
                " of what a texel shows. Bounds are against the map that this gives.",
            std::min(1.0, 0.5 / environment.source_layout.width)};
  }
  return {"border_texels", false, "Texel centres of the file lie at (i + 1/2)/N.", 0};
}

Effect layout_effect(const EnvironmentMapsState& state) {
  const Environment& environment = state.light.environment();
  if (environment.source_layout.kind == LayoutKind::latlong) {
    return {"source_layout", false, "The file is a lat-long map, which is what is baked from.", 0};
  }
  const Image& map = environment.radiance;
  return {"source_layout", true,
          std::string("The file is read as ") + layout_name(environment.source_layout.kind) +
              " and brought to a lat-long map of " + std::to_string(map.width) + " x " +
              std::to_string(map.height) + " texels, as fine as its own, to " +
              short_number(environment.conversion_error) +
              " of what a texel shows. That map is what outputs but layouts are made of, and what "
              "their bounds are against.",
          1};
}

Effect coverage_effect(const EnvironmentMapsState& state) {
  const double missing = 1 - state.light.environment().covered_share;
  if (missing <= 1e-12) return {"source_coverage", false, "The file shows the whole sphere.", 0};
  return {"source_coverage", true,
          "The file does not show " + short_number(100 * missing) +
              " % of the sphere, which is taken as black.",
          missing};
}

Effect rotation_effect(const EnvironmentMapsState& state) {
  const Environment& environment = state.light.environment();
  if (environment.rotation.is_identity()) return {"rotation", false, "Not ordered.", 0};
  return {"rotation", true,
          "Every output is turned as it is made; the map itself is not resampled for it.", 1};
}

Effect harmonics_effect(const EnvironmentMapsState& state) {
  const int bands = state.light.bands();
  if (bands == 0) {
    return {"harmonic_transform", false, "No output of this order is made from harmonics.", 0};
  }
  return {
      "harmonic_transform", true,
      "The map is projected once, to " + std::to_string(bands) + " bands by " +
          std::to_string(state.light.row_points()) +
          " points in each row, which every output that needs harmonics shares." +
          (bands <= direct_row_orders(state.light.environment().radiance.width)
               ? " Nearly all of its time is one pass over the map, which no order makes shorter."
               : ""),
      1};
}

std::vector<Effect> list_effects(EnvironmentMapsState& state) {
  std::vector<Effect> effects = {variation_effect(state),  bright_effect(state),
                                 convention_effect(state), layout_effect(state),
                                 coverage_effect(state),   rotation_effect(state),
                                 harmonics_effect(state)};
  for (const MapsProduct& product : maps_products()) {
    if (!product.ordered(state.parameters()))
      effects.push_back({product.name, false, "Not ordered.", 0});
    else if (product.effect)
      effects.push_back(product.effect(state.light));
    else
      effects.push_back({product.name, true, product.reason, 1});
  }
  return effects;
}

double model_seconds(MapsLight& light, const MapsOutputs& outputs, int check_texels) {
  const Image& map = light.environment().radiance;
  const double width = map.width, height = map.height, bands = bands_of(outputs);
  double seconds = kDecodePerTexel * width * height;
  if (bands > 0) {
    const double row = bands <= direct_row_orders(map.width)
                           ? kDirectPerTexel + kDirectPerOrder * bands
                           : kFourierPerPoint * std::log2(width + 1) *
                                 (Fourier::transforms_directly(map.width) ? 1 : kOddFourier);
    const int points = row_points(map.height, lobes_of(outputs), sh_need_of(outputs));
    seconds += row * width * height + kLegendrePerTerm * points * height * bands * bands;
  }
  for (const auto& output : outputs) {
    seconds += output->model_seconds(light) + output->check_seconds(light) * check_texels;
    if (output->spectrum_need().lobe) seconds += kBrutePerTexel * width * height * check_texels;
  }
  return seconds;
}

// Prices of the quoted errors: each needs its own band limits.
std::vector<Price> list_prices(EnvironmentMapsState& state, double speed) {
  std::vector<Price> prices;
  for (const double error : kQuotedErrors) {
    const MapsOutputs outputs =
        order_outputs(state.parameters(), state.light, working_target(error));
    prices.push_back({error, static_cast<uint64_t>(bands_of(outputs)),
                      speed * model_seconds(state.light, outputs, state.spec.accuracy.check_texels),
                      false});
  }
  return prices;
}

}  // namespace

Plan environment_maps_plan(EnvironmentMapsState& state, Progress& progress) {
  progress.check();
  const double start_s = wall_seconds();
  Plan plan;
  plan.kind = Kind::environment_maps;
  plan.isa = "x86-64";
  plan.effects = list_effects(state);
  const Environment& environment = state.light.environment();
  const PixelRepairs& repairs = environment.repairs;
  if (repairs.nan > 0) plan.repairs.emplace_back("nan_pixels", repairs.nan);
  if (repairs.infinite > 0) plan.repairs.emplace_back("infinite_pixels", repairs.infinite);
  if (repairs.negative > 0) plan.repairs.emplace_back("negative_pixels", repairs.negative);
  plan.warnings = state.warnings;
  if (environment.covered_share < 1 - 1e-12) {
    plan.warnings.push_back("The file shows " + short_number(100 * environment.covered_share) +
                            " % of the sphere; the rest is black.");
  }
  const std::optional<SunExtraction>& sun = state.light.sun();
  if (sun && !sun->found) {
    plan.warnings.push_back("No sun was taken out of the map. " + sun->reason);
  }
  if (!(luminance(environment.mean) > 0)) {
    plan.warnings.push_back("The environment is black: every light output is 0.");
  }
  for (const auto& output : state.outputs) {
    std::string warning = output->warning(state.light);
    if (!warning.empty()) plan.warnings.push_back(std::move(warning));
  }
  plan.elements = state.outputs.size();
  plan.element_unit = "output";
  plan.reference_luminance = 1;
  plan.min_samples = plan.max_samples = static_cast<uint64_t>(state.light.bands());

  const double threads = granted_threads(state.grants.threads);
  const double speed = measure_speed() / threads;
  plan.prices = list_prices(state, speed);
  plan.predicted_s =
      speed * model_seconds(state.light, state.outputs, state.spec.accuracy.check_texels);
  plan.predicted_low_s = plan.predicted_high_s = plan.predicted_s;
  plan.chunks = split_chunks(plan.elements, plan.predicted_s * threads, state.grants.chunk_seconds);
  plan.pilot_s = wall_seconds() - start_s;
  return plan;
}

namespace {

// Maps the loops of one output, each of which runs from 0 to 1, onto a share that only grows.
class OutputProgress {
 public:
  OutputProgress(Progress& job, double begin, double end)
      : part([this, &job, begin, end](double share) {
          const std::lock_guard lock(mutex_);
          furthest_ = std::max(furthest_, begin + (end - begin) * share);
          job.update(furthest_);
          return true;
        }) {}

 private:
  std::mutex mutex_;
  double furthest_ = 0;

 public:
  Progress part;
};

constexpr size_t kMeasuredBytes = 32;

void write_measured(const MeasuredError& measured, ByteWriter& writer) {
  writer.u64(measured.count);
  writer.f64(measured.rms);
  writer.f64(measured.max);
  writer.f64(measured.twin);
}

// What stands at the end of a chunk of `count` outputs.
std::vector<MeasuredError> read_measured(std::span<const std::byte> chunk, size_t count) {
  if (chunk.size() < count * kMeasuredBytes)
    throw Error(ErrorCode::internal, "A chunk of environment maps ends early.");
  ByteReader reader(chunk.last(count * kMeasuredBytes));
  std::vector<MeasuredError> all(count);
  for (MeasuredError& measured : all) {
    measured.count = reader.u64();
    measured.rms = reader.f64();
    measured.max = reader.f64();
    measured.twin = reader.f64();
  }
  return all;
}

}  // namespace

ChunkResult environment_maps_chunk(EnvironmentMapsState& state, const Plan& plan,
                                   const ElementRange& range, Progress& progress) {
  const double start_s = wall_seconds(), start_cpu_s = process_cpu_seconds();
  ChunkResult result;
  ByteWriter writer;
  Round round;
  std::vector<MeasuredError> all_measured;
  state.light.counters() = {};
  for (uint64_t element = range.first; element < range.first + range.count; ++element) {
    progress.check();
    const MapsOutput& output = *state.outputs[static_cast<size_t>(element)];
    const double done = static_cast<double>(element - range.first);
    const double all = static_cast<double>(range.count);
    OutputProgress share(progress, done / all, (done + 1) / all);
    const MeasuredError measured =
        output.make(state.light, state.spec.accuracy.check_texels, writer, share.part);
    all_measured.push_back(measured);
    if (output.bounded())
      judge_output(output.error_bound(), measured, state.target(), &result.report, &round);
    else
      judge_output(measured.rms, {}, state.target(), &result.report, &round);
  }
  for (const MeasuredError& measured : all_measured) write_measured(measured, writer);
  result.bytes = writer.take();
  result.report.counters = state.light.counters();
  result.report.elements = round.elements = range.count;
  result.report.wall_s = round.wall_s = wall_seconds() - start_s;
  result.report.cpu_s = round.cpu_s = process_cpu_seconds() - start_cpu_s;
  round.samples = plan.max_samples;
  result.report.rounds.push_back(round);
  return result;
}

namespace {

// What the bake took, against what was predicted; a price of another error scales with it.
AccuracyRecord record_of(const EnvironmentMapsState& state, const Plan& plan,
                         std::span<const ChunkResult> chunks) {
  std::vector<ChunkReport> reports;
  for (const ChunkResult& chunk : chunks) reports.push_back(chunk.report);
  AccuracyRecord record =
      summarise_accuracy(reports, state.target(), plan.predicted_s,
                         "bound on the rms error over the sphere, relative to the mean of the "
                         "output (SH: to L00; DFG: absolute), or the measured error where larger");
  record.status = record.suspicious > 0       ? AccuracyStatus::suspicious
                  : record.budget_limited > 0 ? AccuracyStatus::budget_limited
                                              : AccuracyStatus::exact;
  record.time_to_error = plan.prices;
  const double ratio = plan.predicted_s > 0 ? record.actual_s / plan.predicted_s : 1;
  for (Price& price : record.time_to_error) {
    price.seconds *= ratio;
    price.extrapolated = price.error != state.target();
  }
  return record;
}

}  // namespace

Assembly environment_maps_assemble(EnvironmentMapsState& state, const Plan& plan,
                                   std::span<const ChunkResult> chunks, Progress& progress) {
  MapsResult result;
  result.threads = state.grants.threads;
  result.faces = state.parameters().cubes.face_orientation;
  EnvironmentDocument& document = result.document;
  document.faces = result.faces;
  const Environment& environment = state.light.environment();
  document.source_width = environment.source_layout.width;
  document.source_height = environment.source_layout.height;
  document.source_layout = environment.source_layout;
  document.source_conversion_error = environment.conversion_error;
  document.source_covered_share = environment.covered_share;
  document.rotation = environment.rotation;
  document.source_format = state.format;
  document.repairs = environment.repairs;
  const std::optional<SunExtraction>& sun = state.light.sun();
  document.mean = sun ? sun->energy_before / (4 * kPi) : environment.mean;
  document.max_luminance = sun ? sun->max_luminance_before : environment.max_luminance;
  for (size_t c = 0; c < chunks.size(); ++c) {
    const ElementRange& range = plan.chunks[c];
    const std::span<const std::byte> bytes = chunks[c].bytes;
    const size_t count = static_cast<size_t>(range.count);
    const std::vector<MeasuredError> measured = read_measured(bytes, count);
    ByteReader reader(bytes.first(bytes.size() - count * kMeasuredBytes));
    for (size_t i = 0; i < count; ++i) {
      progress.check();
      const MapsOutput& output = *state.outputs[static_cast<size_t>(range.first) + i];
      output.file(reader, measured[i], &result);
    }
    if (!reader.at_end()) {
      throw Error(ErrorCode::internal, "A chunk of environment maps holds more than its outputs.");
    }
  }
  result.assembly.document = std::move(document);
  result.assembly.accuracy = record_of(state, plan, chunks);
  return std::move(result.assembly);
}

}  // namespace lightkiln
