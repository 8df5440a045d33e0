#pragma once

// A small scene with everything that path tracing needs, for tests of light.

#include <functional>
#include <memory>
#include <optional>

#include "core/base/statistics.h"
#include "core/trace/radiance.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln::test {

// A lit, single-sided, dielectric material.
Material diffuse(const Vec3& albedo, const Vec3& emission = {});
inline Material grey(float albedo, float emission = 0) {
  return diffuse({albedo, albedo, albedo}, {emission, emission, emission});
}

// Stays where it was made: tracer and kernel refer to the scene.
class LitScene {
 public:
  LitScene(const SceneData& data, std::optional<Environment> environment, const EffectOrder& order);
  LitScene(const LitScene&) = delete;
  LitScene& operator=(const LitScene&) = delete;

  Scene scene;
  std::optional<Environment> environment;
  LightSurvey survey;
  Tracer tracer;
  EffectPlan effects;
  std::unique_ptr<RadianceScene> radiance;

  // Decides the effects anew and builds the kernel; `change` may edit the selection.
  void prepare(const EffectOrder& order,
               const std::function<void(EffectSelection&)>& change = nullptr, unsigned mask = 0);

  // From a point and towards a direction, both in world space.
  Ray ray(const Vec3& origin, const Vec3& direction) const;
};

// Bounces as given, whatever their bound.
inline EffectOrder bounces(int count) {
  return {count, 0.01, 0};
}

// Mean over 16 replicates of `samples` paths, with the 95 % half-width of the luminance.
struct Estimate {
  Vec3d mean;
  double half_width = 0;
};
Estimate estimate(const LitScene& lit, const Ray& ray, uint32_t samples, uint64_t seed = 1,
                  RayCounters* counters = nullptr);

}  // namespace lightkiln::test
