#include "tests/support/lit_scene.h"

#include <vector>

#include "core/base/random.h"

namespace lightkiln::test {

Material diffuse(const Vec3& albedo, const Vec3& emission) {
  Material material;
  material.base_color = albedo;
  material.emissive = emission;
  material.metallic = 0;
  return material;
}

void LitScene::prepare(const EffectOrder& order,
                       const std::function<void(EffectSelection&)>& change, unsigned mask) {
  effects = decide_effects(survey, order);
  if (change) change(effects.selection);
  radiance = std::make_unique<RadianceScene>(tracer, environment ? &*environment : nullptr, survey,
                                             effects.selection, mask);
}

Ray LitScene::ray(const Vec3& origin, const Vec3& direction) const {
  return {to_float(scene.normalisation.to_normalised(to_double(origin))), normalize(direction)};
}

LitScene::LitScene(const SceneData& data, std::optional<Environment> environment_,
                   const EffectOrder& order)
    : scene(make_scene(data)),
      environment(std::move(environment_)),
      survey(survey_light(scene, environment ? &*environment : nullptr)),
      tracer(scene, {}) {
  prepare(order);
}

Estimate estimate(const LitScene& lit, const Ray& ray, uint32_t samples, uint64_t seed,
                  RayCounters* counters) {
  RayCounters local;
  std::vector<double> means;
  Vec3d sum;
  for (uint64_t r = 0; r < kReplicates; ++r) {
    Vec3d replicate;
    for (uint32_t i = 0; i < samples; ++i) {
      replicate += to_double(
          lit.radiance->sample(ray, hash_combine(seed, r), i, counters ? *counters : local));
    }
    means.push_back(luminance(replicate) / samples);
    sum += replicate / samples;
  }
  return {sum / kReplicates, replicate_half_width(means)};
}

}  // namespace lightkiln::test
