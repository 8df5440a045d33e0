#include "core/trace/punctual.h"

#include <algorithm>
#include <cmath>

#include "core/base/pinned_math.h"

namespace lightkiln {

PunctualLights::PunctualLights(const Scene& scene, const LightSurvey& survey,
                               const EffectSelection& selection)
    : metres_per_unit_(1 / scene.normalisation.scale()) {
  double total = 0;
  cdf_.push_back(0);
  std::vector<double> beam_weights;
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    const PunctualLight& light = scene.lights[i];
    const double brightness = luminance(to_double(light.intensity));
    if (!selection.punctual[static_cast<int>(light.kind)] || !(brightness > 0)) continue;
    Light entry{light.kind, scene.normalisation.to_normalised(light.position), light.direction,
                to_double(light.intensity), light.range};
    if (light.kind == LightKind::spot) {
      const double outer = pinned_sin_cos(light.outer_cone_rad).cos;
      entry.cone_scale = 1 / std::max(0.001, pinned_sin_cos(light.inner_cone_rad).cos - outer);
      entry.cone_offset = -outer * entry.cone_scale;
      entry.cone_height = 1 - outer;
    }
    const bool beams = selection.punctual_patches && survey.patches[i] < kSmallPatch;
    beam_weights.push_back(beams ? brightness * entry.cone_height : 0);
    lights_.push_back(entry);
    total += brightness;
    cdf_.push_back(total);
  }
  if (lights_.empty()) return;
  for (double& value : cdf_) value /= total;
  cdf_.back() = 1;
  prepare_beams(beam_weights);
}

// A light is drawn by its power, intensity times solid angle 2 pi h with h the height of its cone's
// cap, and a direction of it with density 1 / (2 pi h).
void PunctualLights::prepare_beams(const std::vector<double>& weights) {
  double total = 0;
  for (const double weight : weights) total += weight;
  beam_cdf_.push_back(0);
  for (size_t i = 0; i < lights_.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    const double share = weights[i] / total;
    lights_[i].beam_density = static_cast<float>(share / (2 * kPi * lights_[i].cone_height));
    beams_.push_back(i);
    beam_cdf_.push_back(beam_cdf_.back() + share);
  }
}

// Uniform on a cap of height h: the distance below its pole is uniform in [0, h) (Archimedes).
LightBeam PunctualLights::beam(const Point4& u) const {
  const auto above =
      std::upper_bound(beam_cdf_.begin() + 1, beam_cdf_.end() - 1, static_cast<double>(u.x));
  const size_t index = beams_[static_cast<size_t>(above - beam_cdf_.begin()) - 1];
  const Light& light = lights_[index];
  const double below = light.cone_height * static_cast<double>(u.y);
  const double radius = std::sqrt(below * (2 - below));
  const SinCos around = pinned_sin_cos(2 * kPi * static_cast<double>(u.z));
  const Vec3 local{static_cast<float>(radius * around.cos), static_cast<float>(radius * around.sin),
                   static_cast<float>(1 - below)};
  const Vec3 axis = light.kind == LightKind::spot ? to_float(light.direction) : Vec3{0, 0, 1};
  return {index, to_float(light.position), normalize(make_basis(axis).to_world(local))};
}

float PunctualLights::chance(size_t light) const {
  if (lights_.size() <= kEveryLight) return 1;
  return static_cast<float>(cdf_[light + 1] - cdf_[light]);
}

// From the glTF extension KHR_lights_punctual: attenuation = max(min(1 - (d / range)^4, 1), 0) /
// d^2, and for a spot the square of saturate(cos * scale + offset) with
// scale = 1 / max(0.001, cos inner - cos outer), offset = -cos outer * scale.
bool PunctualLights::light_at(size_t index, const Vec3& point, PunctualSample* sample) const {
  const Light& light = lights_[index];
  if (light.kind == LightKind::directional) {
    *sample = {to_float(-light.direction), to_float(light.intensity), true};
    return true;
  }
  const Vec3d to_light = light.position - to_double(point);
  const double distance = length(to_light) * metres_per_unit_;
  if (!(distance > 0)) return false;
  double attenuation = 1 / (distance * distance);
  if (light.range > 0) {
    const double ratio = distance / light.range;
    attenuation *= std::clamp(1 - ratio * ratio * ratio * ratio, 0.0, 1.0);
  }
  if (light.kind == LightKind::spot) {
    const double cosine = -dot(light.direction, to_light) / length(to_light);
    const double cone = std::clamp(cosine * light.cone_scale + light.cone_offset, 0.0, 1.0);
    attenuation *= cone * cone;
  }
  *sample = {to_float(to_light), to_float(light.intensity * attenuation), false};
  return attenuation > 0;
}

size_t PunctualLights::choose(float choice, float* probability) const {
  const auto above =
      std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, static_cast<double>(choice));
  const auto index = static_cast<size_t>(above - cdf_.begin()) - 1;
  *probability = static_cast<float>(cdf_[index + 1] - cdf_[index]);
  return index;
}

}  // namespace lightkiln
