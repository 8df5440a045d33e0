#include "core/bake/environment_outputs.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/environment/dfg.h"

namespace lightkiln {

namespace {

// Seconds an operation on the model's core, measured on a 2048 x 1024 map.
constexpr double kDecodePerTexel = 4e-9;     // statistics; decoding is the input's own time
constexpr double kFourierPerPoint = 2.7e-9;  // times log2 of the width
constexpr double kLegendrePerTerm = 3.5e-10;
constexpr double kRingPerTerm = 7e-9;  // bands^3
constexpr double kPerTexel = 4e-8;     // interpolation
constexpr double kPerBrightTexel = 7e-9;
constexpr double kResamplePerCell = 1.3e-8;
constexpr double kPerDfgValue = 2.8e-6;

}  // namespace

std::optional<double> EnvironmentOutput::alpha() const {
  if (kind == OutputKind::irradiance) return 1.0;
  if (kind == OutputKind::level && roughness > 0) return roughness * roughness;
  return std::nullopt;
}

std::vector<EnvironmentOutput> ordered_outputs(const EnvironmentMapsParameters& parameters) {
  std::vector<EnvironmentOutput> outputs;
  if (parameters.sh) outputs.push_back({OutputKind::sh, parameters.sh->bands, 0, 0});
  if (parameters.irradiance) {
    outputs.push_back({OutputKind::irradiance, parameters.irradiance->size, 0, 0});
  }
  if (parameters.prefilter) {
    const int levels = parameters.prefilter->levels;
    for (int level = 0; level < levels; ++level) {
      outputs.push_back({OutputKind::level, parameters.prefilter->size >> level, level,
                         double(level) / (levels - 1)});
    }
  }
  if (parameters.dfg) outputs.push_back({OutputKind::dfg, parameters.dfg->size, 0, 0});
  return outputs;
}

double working_target(double target_error) {
  return 0.1 * target_error;
}

std::vector<LobePlan> plan_lobes(const LightStatistics& light,
                                 const std::vector<EnvironmentOutput>& outputs, double target) {
  std::vector<LobePlan> lobes;
  for (const EnvironmentOutput& output : outputs) {
    const std::optional<double> alpha = output.alpha();
    lobes.push_back(alpha ? plan_lobe(light, *alpha, target) : LobePlan{});
  }
  return lobes;
}

int transform_bands(const std::vector<EnvironmentOutput>& outputs,
                    const std::vector<LobePlan>& lobes) {
  int bands = 0;
  for (size_t i = 0; i < outputs.size(); ++i) {
    bands = std::max(bands, outputs[i].kind == OutputKind::sh ? outputs[i].size : 0);
    if (i < lobes.size()) bands = std::max(bands, lobes[i].bands);
  }
  return bands;
}

double model_seconds(const Environment& environment, const LightStatistics& light,
                     const std::vector<EnvironmentOutput>& outputs,
                     const std::vector<LobePlan>& lobes) {
  const double width = environment.radiance.width, height = environment.radiance.height;
  const double bands = transform_bands(outputs, lobes);
  double seconds = kDecodePerTexel * width * height;
  if (bands > 0) {
    seconds += kFourierPerPoint * width * height * std::log2(width + 1) +
               kLegendrePerTerm * height * bands * bands;
  }
  for (size_t i = 0; i < outputs.size(); ++i) {
    const EnvironmentOutput& output = outputs[i];
    const double texels = 6.0 * output.size * output.size;
    if (output.kind == OutputKind::dfg) {
      seconds += kPerDfgValue * output.size * output.size;
    } else if (i < lobes.size() && lobes[i].bands > 0) {
      const double cut = lobes[i].bands;
      seconds += kRingPerTerm * cut * cut * cut + kPerTexel * texels;
      if (lobes[i].corrected) {
        seconds += kPerBrightTexel * texels * static_cast<double>(light.bright.size());
      }
    } else if (output.kind == OutputKind::level) {
      seconds += kResamplePerCell * (width + 4 * output.size) * (height + 2 * output.size);
    }
  }
  return seconds;
}

double measure_speed() {
  constexpr int kCount = 64;
  double sum = 0;
  const double start_s = thread_cpu_seconds();
  for (int i = 1; i <= kCount; ++i) sum += ggx_dfg(0.25, double(i) / kCount).scale;
  const double spent_s = thread_cpu_seconds() - start_s;
  return sum > 0 ? std::clamp(spent_s / (kCount * kPerDfgValue), 0.05, 20.0) : 1.0;
}

}  // namespace lightkiln
