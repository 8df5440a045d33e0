// Environment maps: SH, irradiance, GGX-prefiltered levels and the DFG table, each made only when
// ordered. An element is an output; a chunk's bytes are its outputs' values in order: SH as doubles
// (R, G, B a coefficient), images as floats.

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/bake/environment_outputs.h"
#include "core/bake/kitchen.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/environment/dfg.h"
#include "core/environment/resample.h"
#include "core/image/decode.h"

namespace lightkiln {

namespace {

// Quadrature along rows and rounding, relative to L00.
constexpr double kShErrorBound = 1e-7;

}  // namespace

struct EnvironmentMapsState {
  Spec spec;
  Grants grants;
  std::string format;
  EnvmapAttribute envmap = EnvmapAttribute::none;
  Environment environment;
  LightStatistics light;
  std::vector<EnvironmentOutput> outputs;
  std::vector<LobePlan> lobes;  // one per output; empty when the map is constant
  // Projected at the first output that needs it. Its bands follow from the spec alone.
  std::optional<LatlongSpectrum> spectrum;

  double target() const { return target_error(spec); }
  int threads() const { return grants.threads; }
};

void EnvironmentMapsStateDeleter::operator()(EnvironmentMapsState* state) const {
  delete state;
}

std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> environment_maps_open(
    const Spec& spec, const Inputs& inputs, const Grants& grants) {
  std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> state(
      new EnvironmentMapsState);
  state->spec = spec;
  state->grants = grants;
  const DecodedImage decoded = decode_hdr_image(blob_bytes(spec.environment.value(), inputs));
  state->format = decoded.format;
  state->envmap = decoded.envmap;
  state->environment = make_environment(decoded);
  state->outputs = ordered_outputs(std::get<EnvironmentMapsParameters>(spec.parameters));
  const bool lit = std::any_of(state->outputs.begin(), state->outputs.end(),
                               [](const auto& o) { return o.kind != OutputKind::dfg; });
  if (lit && !state->environment.constant) {
    state->light = measure_light(state->environment);
    state->lobes = plan_lobes(state->light, state->outputs, working_target(state->target()));
  }
  return state;
}

namespace {

Effect output_effect(const char* name, bool ordered, const std::string& reason) {
  if (!ordered) return {name, false, "Not ordered.", 0};
  return {name, true, reason, 1};
}

double output_bound(const EnvironmentMapsState& state, size_t index) {
  const EnvironmentOutput& output = state.outputs[index];
  if (output.kind == OutputKind::dfg) return kDfgErrorBound;
  if (state.environment.constant) return 0;
  if (output.kind == OutputKind::sh) return kShErrorBound;
  return output.alpha() ? state.lobes[index].error_bound : kResampleError;
}

Effect variation_effect(const EnvironmentMapsState& state) {
  if (state.environment.constant) {
    return {"environment_variation", false,
            "Every texel is equal: all light outputs are that value in closed form.", 0};
  }
  if (state.lobes.empty()) {
    return {"environment_variation", false, "No output that depends on the light is ordered.", 0};
  }
  return {"environment_variation", true,
          "Radiance varies over the map: its standard deviation is " +
              short_number(state.light.spread) + " of its mean.",
          state.light.spread};
}

Effect bright_effect(const EnvironmentMapsState& state) {
  double bound = 0;
  bool active = false;
  for (const LobePlan& lobe : state.lobes) {
    if (!lobe.corrected) continue;
    active = true;
    bound = std::max(bound, lobe.uncorrected_bound);
  }
  if (!active) {
    return {"bright_texels", false,
            "No texel is so bright that the band limits of this order would show.", 0};
  }
  return {"bright_texels", true,
          std::to_string(state.light.bright.size()) + " texels hold " +
              short_number(100 * state.light.bright_share) +
              " % of the light: what the band limits cut off them is added in closed form.",
          bound};
}

Effect convention_effect(const EnvironmentMapsState& state) {
  if (state.envmap == EnvmapAttribute::latlong) {
    const int width = state.environment.radiance.width;
    return {"border_texels", true,
            "The file says envmap = latlong, whose outer pixel centres lie on the borders: it was "
            "resampled to centres at (i + 1/2)/N.",
            std::min(1.0, 0.5 / width)};
  }
  return {"border_texels", false,
          "The file carries no envmap attribute: texel centres lie at (i + 1/2)/N.", 0};
}

std::vector<Effect> list_effects(const EnvironmentMapsState& state) {
  const auto& parameters = std::get<EnvironmentMapsParameters>(state.spec.parameters);
  std::string bands;
  for (size_t i = 0; i < state.outputs.size(); ++i) {
    if (state.outputs[i].kind != OutputKind::level || i >= state.lobes.size()) continue;
    if (state.lobes[i].bands > 0)
      bands += (bands.empty() ? "" : ", ") + short_number(state.lobes[i].bands);
  }
  return {variation_effect(state),
          bright_effect(state),
          convention_effect(state),
          output_effect("sh", parameters.sh.has_value(), "Spherical harmonics are ordered."),
          output_effect("irradiance", parameters.irradiance.has_value(),
                        "An irradiance cube is ordered."),
          output_effect("prefilter", parameters.prefilter.has_value(),
                        bands.empty() ? "A prefiltered chain is ordered."
                                      : "A prefiltered chain is ordered; its rough levels need " +
                                            bands + " bands."),
          output_effect("dfg", parameters.dfg.has_value(), "A DFG table is ordered.")};
}

// Prices of the quoted errors: each needs its own band limits.
std::vector<Price> list_prices(const EnvironmentMapsState& state, double speed) {
  std::vector<Price> prices;
  for (const double error : kQuotedErrors) {
    const std::vector<LobePlan> lobes =
        state.lobes.empty() ? std::vector<LobePlan>{}
                            : plan_lobes(state.light, state.outputs, working_target(error));
    const int bands = state.lobes.empty() ? 0 : transform_bands(state.outputs, lobes);
    prices.push_back({error, static_cast<uint64_t>(bands),
                      speed * model_seconds(state.environment, state.light, state.outputs, lobes),
                      false});
  }
  return prices;
}

const LatlongSpectrum& spectrum_of(EnvironmentMapsState& state, Progress& progress) {
  if (!state.spectrum) {
    int sh_bands = 1;
    for (const EnvironmentOutput& output : state.outputs) {
      if (output.kind == OutputKind::sh) sh_bands = output.size;
    }
    state.spectrum =
        project_for(state.environment, state.lobes, sh_bands, state.threads(), progress);
  }
  return *state.spectrum;
}

ShRgb make_sh(EnvironmentMapsState& state, int bands, Progress& progress) {
  if (!state.environment.constant) {
    return world_harmonics(spectrum_of(state, progress), bands);
  }
  ShRgb sh(bands);
  sh.coefficients[0] = state.environment.mean * (2 * std::sqrt(kPi));
  return sh;
}

Image constant_cube(const Vec3d& value, int size) {
  Image cube(size, 6 * size, 3);
  const Vec3 radiance = to_float(value);
  for (size_t i = 0; i < cube.pixels.size(); i += 3) std::copy_n(&radiance.x, 3, &cube.pixels[i]);
  return cube;
}

Image make_image(EnvironmentMapsState& state, size_t index, Progress& progress) {
  const EnvironmentOutput& output = state.outputs[index];
  if (output.kind == OutputKind::dfg) {
    return ggx_dfg_table(output.size, state.threads(), progress);
  }
  const double scale = output.kind == OutputKind::irradiance ? kPi : 1.0;
  if (state.environment.constant) {
    return constant_cube(state.environment.mean * scale, output.size);
  }
  if (!output.alpha()) {
    return resample_to_cube(state.environment.radiance, output.size, state.threads(), progress);
  }
  Image cube = convolve_lobe(state.light, spectrum_of(state, progress), state.lobes[index],
                             output.size, state.threads(), progress);
  if (output.kind == OutputKind::irradiance) {
    for (float& value : cube.pixels) value = static_cast<float>(scale * double(value));
  }
  return cube;
}

}  // namespace

Plan environment_maps_plan(EnvironmentMapsState& state, Progress& progress) {
  progress.check();
  const double start_s = wall_seconds();
  Plan plan;
  plan.kind = Kind::environment_maps;
  plan.isa = "x86-64";
  plan.effects = list_effects(state);
  const PixelRepairs& repairs = state.environment.repairs;
  if (repairs.nan > 0) plan.repairs.emplace_back("nan_pixels", repairs.nan);
  if (repairs.infinite > 0) plan.repairs.emplace_back("infinite_pixels", repairs.infinite);
  if (repairs.negative > 0) plan.repairs.emplace_back("negative_pixels", repairs.negative);
  if (!(luminance(state.environment.mean) > 0)) {
    plan.warnings.push_back("The environment is black: every light output is 0.");
  }
  plan.elements = state.outputs.size();
  plan.element_unit = "output";
  plan.reference_luminance = 1;
  const int bands = state.environment.constant ? 0 : transform_bands(state.outputs, state.lobes);
  plan.min_samples = plan.max_samples = static_cast<uint64_t>(bands);

  const double threads = granted_threads(state.grants.threads);
  const double speed = measure_speed() / threads;
  plan.prices = list_prices(state, speed);
  plan.predicted_s =
      speed * model_seconds(state.environment, state.light, state.outputs, state.lobes);
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

}  // namespace

ChunkResult environment_maps_chunk(EnvironmentMapsState& state, const Plan& plan,
                                   const ElementRange& range, Progress& progress) {
  const double start_s = wall_seconds(), start_cpu_s = process_cpu_seconds();
  ChunkResult result;
  ByteWriter writer;
  Round round;
  for (uint64_t element = range.first; element < range.first + range.count; ++element) {
    progress.check();
    const size_t index = static_cast<size_t>(element);
    const double done = static_cast<double>(element - range.first);
    const double all = static_cast<double>(range.count);
    OutputProgress output(progress, done / all, (done + 1) / all);
    if (state.outputs[index].kind == OutputKind::sh) {
      const int bands = state.outputs[index].size;
      for (const Vec3d& c : make_sh(state, bands, output.part).coefficients) {
        writer.f64(c.x);
        writer.f64(c.y);
        writer.f64(c.z);
      }
    } else {
      writer.floats(make_image(state, index, output.part).pixels);
    }
    const double bound = output_bound(state, index);
    round.error_sum_sq += bound * bound;
    round.error_max = std::max(round.error_max, bound);
    const bool reached = bound <= state.target();
    round.converged += reached ? 1 : 0;
    result.report.budget_limited += reached ? 0 : 1;
  }
  result.bytes = writer.take();
  result.report.elements = round.elements = range.count;
  result.report.wall_s = round.wall_s = wall_seconds() - start_s;
  result.report.cpu_s = round.cpu_s = process_cpu_seconds() - start_cpu_s;
  round.samples = plan.max_samples;
  result.report.rounds.push_back(round);
  return result;
}

namespace {

Artifact cube_artifact(const std::string& name, const Image& cube,
                       std::map<std::string, std::string> attributes) {
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  options.attributes = std::move(attributes);
  return {name, "image", "image/x-exr", write_exr(cube, options)};
}

// Half-texel centres are what engines sample. OpenEXR's `envmap` attribute would claim centres on
// the borders and is therefore not written; these attributes say what the file is.
const std::map<std::string, std::string> kCubeAttributes = {
    {"lightkiln.layout",
     "cube: six faces from the top, +X -X +Y -Y +Z -Z, as OpenEXR orients them"},
    {"lightkiln.texel_convention", "half_texel: texel centres at (i + 1/2)/N of a face"}};

void add_image(const EnvironmentOutput& output, double bound, const Image& image,
               Assembly* assembly, EnvironmentDocument* document) {
  if (output.kind == OutputKind::dfg) {
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    options.attributes["lightkiln.axes"] =
        "column: n.v = (x + 1/2)/size; row: roughness = (y + 1/2)/size from the top; R: scale of "
        "F0, G: bias";
    assembly->artifacts.push_back({"dfg.exr", "image", "image/x-exr", write_exr(image, options)});
    document->dfg_artifact = "dfg.exr";
    document->dfg_size = output.size;
    document->dfg_error_bound = bound;
    return;
  }
  std::map<std::string, std::string> attributes = kCubeAttributes;
  if (output.kind == OutputKind::irradiance) {
    attributes["lightkiln.quantity"] = "irradiance at a surface whose normal is the direction";
    assembly->artifacts.push_back(cube_artifact("irradiance.exr", image, attributes));
    document->irradiance_artifact = "irradiance.exr";
    document->irradiance_size = output.size;
    document->irradiance_error_bound = bound;
    return;
  }
  const std::string name = "prefilter_" + std::to_string(output.index) + ".exr";
  attributes["lightkiln.quantity"] = "radiance prefiltered with GGX, n = v = r";
  attributes["lightkiln.roughness"] = short_number(output.roughness);
  assembly->artifacts.push_back(cube_artifact(name, image, attributes));
  document->prefilter.push_back({name, output.size, output.roughness, bound});
}

ShDocument read_sh(const EnvironmentOutput& output, double bound, ByteReader& reader) {
  ShDocument document;
  document.sh = ShRgb(output.size);
  for (Vec3d& c : document.sh.coefficients) {
    c.x = reader.f64();
    c.y = reader.f64();
    c.z = reader.f64();
  }
  document.selftest = make_selftest(document.sh);
  document.error = bound;
  return document;
}

// What the bake took, against what was predicted; a price of another error scales with it.
AccuracyRecord record_of(const EnvironmentMapsState& state, const Plan& plan,
                         std::span<const ChunkResult> chunks) {
  std::vector<ChunkReport> reports;
  for (const ChunkResult& chunk : chunks) reports.push_back(chunk.report);
  AccuracyRecord record =
      summarise_accuracy(reports, state.target(), plan.predicted_s,
                         "bound on the rms error over the sphere, relative to the mean of the "
                         "output (SH: to L00; DFG: absolute)");
  record.status =
      record.budget_limited > 0 ? AccuracyStatus::budget_limited : AccuracyStatus::exact;
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
  Assembly assembly;
  EnvironmentDocument document;
  document.source_width = state.environment.radiance.width;
  document.source_height = state.environment.radiance.height;
  document.source_format = state.format;
  document.repairs = state.environment.repairs;
  document.mean = state.environment.mean;
  document.max_luminance = state.environment.max_luminance;
  for (size_t c = 0; c < chunks.size(); ++c) {
    ByteReader reader(chunks[c].bytes);
    const ElementRange& range = plan.chunks[c];
    for (uint64_t element = range.first; element < range.first + range.count; ++element) {
      progress.check();
      const size_t index = static_cast<size_t>(element);
      const EnvironmentOutput& output = state.outputs[index];
      const double bound = output_bound(state, index);
      if (output.kind == OutputKind::sh) {
        document.sh.push_back(read_sh(output, bound, reader));
        continue;
      }
      const bool table = output.kind == OutputKind::dfg;
      Image image(output.size, table ? output.size : 6 * output.size, 3);
      reader.floats(image.pixels);
      add_image(output, bound, image, &assembly, &document);
    }
    if (!reader.at_end()) {
      throw Error(ErrorCode::internal, "A chunk of environment maps holds more than its outputs.");
    }
  }
  assembly.document = std::move(document);
  assembly.accuracy = record_of(state, plan, chunks);
  return assembly;
}

}  // namespace lightkiln
