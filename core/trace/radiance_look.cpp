// Light looked for from where it is, instead of where rays happen to go.

#include <cmath>

#include "core/trace/radiance.h"

namespace lightkiln {

namespace {

constexpr float kInversePi = static_cast<float>(1 / kPi);

// The power heuristic's weight p^2 / (p^2 + q'^2) of light found with density p, times q / p, so
// that it counts like a ray of density q; p may be infinite. `q_found` is q' where rays that meet
// the light find it with less than certainty.
float weight_of_found(float q, float p, float q_found) {
  const float ratio = q_found / p;
  return q / p / (1 + ratio * ratio);
}
float weight_of_found(float q, float p) {
  return 1 / (q / p + p / q);
}

}  // namespace

DimensionSet dimensions_of(Sight sight) {
  switch (sight) {
    case Sight::glare:
      return DimensionSet::probe_glare;
    case Sight::lamps:
      return DimensionSet::probe_lamp;
    case Sight::unlit:
      return DimensionSet::probe_unlit;
    case Sight::patches:
      break;
  }
  return DimensionSet::probe_patch;
}

bool RadianceScene::has(Sight sight) const {
  switch (sight) {
    case Sight::glare:
      return glare_ != nullptr;
    case Sight::lamps:
      return !lamps_.empty();
    case Sight::unlit:
      return !unlit_.empty();
    case Sight::patches:
      return punctual_.has_beams() && selection_.max_bounces > 0;
  }
  return false;
}

DirectLight RadianceScene::look(Sight sight, const Vec3& origin, const Point4& u,
                                const FirstDensity& density, RayCounters& counters) const {
  switch (sight) {
    case Sight::glare:
      return look_for_glare(origin, u, density, counters);
    case Sight::lamps:
      return look_for_surface(lamps_, origin, u, density, counters);
    case Sight::unlit:
      return look_for_surface(unlit_, origin, u, density, counters);
    case Sight::patches:
      return look_for_patch(origin, u, density, counters);
  }
  return {};
}

DirectLight RadianceScene::look_for_glare(const Vec3& origin, const Point4& u,
                                          const FirstDensity& density,
                                          RayCounters& counters) const {
  const EnvironmentSampler::Sample light = glare_->sample(u.x, u.y);
  ++counters.environment_reads;
  ++counters.shadow_rays;
  if (tracer_->occluded({origin, light.direction, 0, INFINITY}, counters)) return {};
  return {light.direction, light.radiance * weight_of_found(density(light.direction), light.pdf)};
}

DirectLight RadianceScene::look_for_surface(const EmissiveSampler& shining, const Vec3& origin,
                                            const Point4& u, const FirstDensity& density,
                                            RayCounters& counters) const {
  const EmissiveSampler::Draw drawn = shining.sample(u);
  const SurfaceRecord& record = colors_.record(drawn.point.mesh);
  const SurfacePoint there = surface_point(tracer_->scene(), drawn.point);
  const Vec3 between = there.position - origin;
  const float distance2 = dot(between, between);
  if (!(distance2 > 0)) return {};
  const Vec3 direction = between / std::sqrt(distance2);
  const float facing = -dot(there.normal, direction);
  // Unlit surfaces show their colour on both sides.
  const bool shown = facing > 0 || (facing < 0 && (record.double_sided || record.unlit));
  if (!shown || !colors_.present(drawn.point, counters)) return {};
  ++counters.shadow_rays;
  const Vec3 along = offset_origin(there, -direction) - origin;
  if (tracer_->occluded({origin, along, 0, kSegment}, counters)) return {};
  const float weight =
      weight_of_found(density(direction) * std::abs(facing), drawn.area_density * distance2);
  const Vec3 radiance = record.unlit ? colors_.base_color<true>(drawn.point, counters)
                                     : colors_.emission<true>(drawn.point, counters);
  return {direction, radiance * weight};
}

// The ray's density per steradian around the light, over the squared distance, times the cosine
// there. What the point reflects is rho / pi E cos.
bool RadianceScene::patch(const Point4& u, RayCounters& counters, Patch* found) const {
  const LightBeam beam = punctual_.beam(u);
  ++counters.bounce_rays;
  const Hit hit = tracer_->nearest({beam.origin, beam.direction}, counters);
  if (!hit.hit() || colors_.record(hit.mesh).unlit) return false;
  found->point = surface_point(tracer_->scene(), hit);
  const float facing = -dot(found->point.normal, beam.direction);
  found->normal = facing > 0 ? found->point.normal : -found->point.normal;
  PunctualSample light;
  if (!punctual_.light_at(beam.light, found->point.position, &light)) return false;
  const float cosine = std::abs(facing);
  found->area_density =
      punctual_.beam_density(beam.light) * cosine / dot(light.to_light, light.to_light);
  found->chance = punctual_.chance(beam.light);
  found->radiance =
      colors_.base_color<true>(hit, counters) * light.irradiance * (cosine * kInversePi);
  return found->area_density > 0;
}

DirectLight RadianceScene::look_for_patch(const Vec3& origin, const Point4& u,
                                          const FirstDensity& density,
                                          RayCounters& counters) const {
  Patch patch;
  if (!this->patch(u, counters, &patch)) return {};
  const Vec3 between = patch.point.position - origin;
  const float distance2 = dot(between, between);
  if (!(distance2 > 0)) return {};
  const Vec3 direction = between / std::sqrt(distance2);
  const float facing = -dot(patch.normal, direction);
  if (!(facing > 0)) return {};
  ++counters.shadow_rays;
  const Vec3 along = offset_origin(patch.point, -direction) - origin;
  if (tracer_->occluded({origin, along, 0, kSegment}, counters)) return {};
  const float met = density(direction) * facing;
  return {direction, patch.radiance *
                         weight_of_found(met, patch.area_density * distance2, met * patch.chance)};
}

}  // namespace lightkiln
