#include "core/trace/radiance.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "core/base/pinned_math.h"
#include "core/base/random.h"

namespace lightkiln {

namespace {

constexpr float kInversePi = static_cast<float>(1 / kPi);

enum class PathDimension : uint64_t { scatter = 0, environment = 1, emissive = 2, punctual = 3 };

uint64_t path_key(uint64_t key, int vertex, PathDimension dimension) {
  return hash_combine(key, static_cast<uint64_t>(DimensionSet::path_base) +
                               4 * static_cast<uint64_t>(vertex) +
                               static_cast<uint64_t>(dimension));
}

// Power heuristic with exponent 2 for one sample each: p^2 / (p^2 + q^2), written so that densities
// near the ends of float's range do not overflow.
float power_heuristic(float p, float q) {
  if (!(q > 0)) return 1;
  const float ratio = q / p;  // p = 0: infinite, weight 0
  return 1 / (1 + ratio * ratio);
}

// Cosine-weighted: a point (x, y) uniform on the unit disk lifted to z = sqrt(1 - x^2 - y^2) has
// density cos(theta) / pi per steradian (Malley). Polar mapping.
Vec3 cosine_hemisphere(float u, float v) {
  const float r = std::sqrt(u);
  const SinCos around = pinned_sin_cos(2 * kPi * static_cast<double>(v));
  return {r * static_cast<float>(around.cos), r * static_cast<float>(around.sin), std::sqrt(1 - u)};
}

struct Vertex {
  SurfacePoint point;
  Vec3 normal;  // geometric, towards where the path came from
  // Per normalised area, of arriving here rather than being connected to; 0 where nothing connects.
  float arrival_density = 0;
};

}  // namespace

namespace {

struct SampleRound {
  uint32_t first, length;
};
SampleRound round_of(uint32_t index) {
  if (index < kFirstSamples) return {0, kFirstSamples};
  return {std::bit_floor(index), std::bit_floor(index)};
}

}  // namespace

int most_halvings(uint32_t index) {
  return std::min(kMostHalvings, std::countr_zero(round_of(index).length));
}

bool survives(uint32_t index, int halvings) {
  const SampleRound round = round_of(index);
  return index - round.first < (round.length >> halvings);
}

unsigned radiance_mask(const EffectSelection& s) {
  unsigned mask = 0;
  if (s.environment) mask |= kEnvironmentBit;
  if (s.environment && s.environment_sampling) mask |= kEnvironmentSamplingBit;
  if (s.emissive) mask |= kEmissionBit;
  if (s.punctual[0] || s.punctual[1] || s.punctual[2]) mask |= kPunctualBit;
  if (s.textures || s.vertex_colors) mask |= kSurfaceDetailBit;
  return mask;
}

template <unsigned kMask>
struct PathKernel {
  static constexpr bool kDetail = (kMask & kSurfaceDetailBit) != 0;

  const RadianceScene& scene;
  uint64_t key;
  uint32_t index;
  RayCounters& counters;
  float first_density;
  Vec3 radiance{};
  Vec3 throughput{1, 1, 1};
  float thinning = 1;     // the part of throughput that stands for samples that ended early
  float scatter_pdf = 0;  // of the ray under way; 0 for the first, which nothing else could sample
  bool first = true;

  static Vec3 run(const RadianceScene& scene, const Ray& ray, uint64_t key, uint32_t index,
                  RayCounters& counters, float first_density) {
    PathKernel kernel{scene, key, index, counters, first_density};
    kernel.trace(ray);
    return kernel.radiance;
  }

  void trace(Ray ray) {
    const EffectSelection& selection = scene.selection_;
    for (int vertex = 0;; ++vertex) {
      first = vertex == 0;
      first ? ++counters.nearest_rays : ++counters.bounce_rays;
      const Hit hit = scene.tracer_->nearest(ray, counters);
      if (!hit.hit()) return add_environment(ray.direction);
      Vertex here;
      here.point = surface_point(scene.tracer_->scene(), hit);
      const bool front = dot(here.point.normal, ray.direction) < 0;
      here.normal = front ? here.point.normal : -here.point.normal;
      here.arrival_density = (first ? first_density : scatter_pdf) *
                             -dot(here.normal, ray.direction) / (hit.t * hit.t);
      const SurfaceRecord& record = scene.colors_.record(hit.mesh);
      if (record.unlit) {
        if (first) show_unlit(hit, -dot(here.normal, ray.direction));
        return;
      }
      if constexpr ((kMask & kEmissionBit) != 0) {
        if (record.emits && (front || record.double_sided)) {
          add_emission(hit, -dot(here.normal, ray.direction));
        }
      }
      if (vertex >= selection.max_bounces) return;
      throughput = throughput * scene.colors_.base_color<kDetail>(hit, counters);
      if (spent()) return;
      add_lights(here, vertex);
      if (!goes_on(vertex + 1)) return;
      ray = scatter(here, vertex);
    }
  }

  // No light left to carry: black surface, or under the floor that the order's bound allows. The
  // weight of thinning makes up for paths that ended, so it is no light of this one.
  bool spent() const {
    const float largest = std::max(throughput.x, std::max(throughput.y, throughput.z));
    return largest <= scene.selection_.throughput_floor * thinning;
  }

  // The fixed shares of samples that visit deep vertices, at weights that make up for them.
  bool goes_on(int next_vertex) {
    const int halvings = most_halvings(index);
    for (int i = 0; i < halvings; ++i) {
      if (next_vertex != scene.selection_.halving[i]) continue;
      if (!survives(index, i + 1)) return false;
      throughput *= 2.0f;
      thinning *= 2.0f;
    }
    return true;
  }

  Ray scatter(const Vertex& here, int vertex) {
    const Point2 u = sobol2(path_key(key, vertex, PathDimension::scatter), index);
    const Vec3 local = cosine_hemisphere(u.x, u.y);
    const Vec3 direction = normalize(make_basis(here.normal).to_world(local));
    scatter_pdf = local.z * kInversePi;
    return {offset_origin(here.point, direction), direction};
  }

  void add_environment(const Vec3& direction) {
    if constexpr ((kMask & kEnvironmentBit) != 0) {
      if (scene.environment_ == nullptr) return;
      ++counters.environment_reads;
      float weight = 1;
      if constexpr ((kMask & kEnvironmentSamplingBit) != 0) {
        if (!first && scene.environment_sampler_) {
          weight = power_heuristic(scatter_pdf, scene.environment_sampler_->pdf(direction));
        } else if (first && first_density > 0 && scene.glare_) {
          weight = power_heuristic(first_density, scene.glare_->pdf(direction));
        }
      }
      radiance += throughput * environment_radiance(*scene.environment_, direction) * weight;
    }
  }

  void show_unlit(const Hit& hit, float cosine) {
    float weight = 1;
    if (first_density > 0 && !scene.unlit_.empty()) {
      weight =
          power_heuristic(first_density * cosine, scene.unlit_.area_density(hit) * hit.t * hit.t);
    }
    radiance += scene.colors_.base_color<kDetail>(hit, counters) * weight;
  }

  // Density per solid angle of the emitters' sampler: density per area times d^2 / cos.
  void add_emission(const Hit& hit, float cosine) {
    float weight = 1;
    const EmissiveSampler& looking = first ? scene.lamps_ : scene.emitters_;
    const float met = first ? first_density : scatter_pdf;
    if (!looking.empty() && met > 0) {
      weight = power_heuristic(met * cosine, looking.area_density(hit) * hit.t * hit.t);
    }
    radiance += throughput * scene.colors_.emission<kDetail>(hit, counters) * weight;
  }

  void add_lights(const Vertex& here, int vertex) {
    if constexpr ((kMask & kEnvironmentSamplingBit) != 0) {
      if (scene.environment_sampler_) light_from_environment(here, vertex);
    }
    if constexpr ((kMask & kEmissionBit) != 0) {
      if (!scene.emitters_.empty()) light_from_emitters(here, vertex);
    }
    if constexpr ((kMask & kPunctualBit) != 0) {
      light_from_punctual(here, vertex);
      if (scene.punctual_.has_beams() && vertex + 1 < scene.selection_.max_bounces) {
        light_from_patches(here, vertex);
      }
    }
  }

  bool shadowed(const Vec3& origin, const Vec3& direction, float end) {
    ++counters.shadow_rays;
    return scene.tracer_->occluded({origin, direction, 0, end}, counters);
  }

  // rho / pi L cos / p, weighted against the scattered ray's density cos / pi.
  void light_from_environment(const Vertex& here, int vertex) {
    const Point2 u = sobol2(path_key(key, vertex, PathDimension::environment), index);
    const EnvironmentSampler::Sample light = scene.environment_sampler_->sample(u.x, u.y);
    const float cosine = dot(here.normal, light.direction);
    if (!(cosine > 0)) return;
    ++counters.environment_reads;
    if (shadowed(offset_origin(here.point, light.direction), light.direction, INFINITY)) return;
    const float scattered = cosine * kInversePi;
    radiance += throughput * light.radiance *
                (scattered / light.pdf * power_heuristic(light.pdf, scattered));
  }

  // rho / pi L cos cos' / (d^2 p_area).
  void light_from_emitters(const Vertex& here, int vertex) {
    const Point4 u = sobol4(path_key(key, vertex, PathDimension::emissive), index);
    const EmissiveSampler::Draw drawn = scene.emitters_.sample(u);
    const Hit& light = drawn.point;
    const SurfacePoint there = surface_point(scene.tracer_->scene(), light);
    const Vec3 between = there.position - here.point.position;
    const float distance2 = dot(between, between);
    if (!(distance2 > 0)) return;
    const Vec3 direction = between / std::sqrt(distance2);
    const float cosine = dot(here.normal, direction);
    const float facing = -dot(there.normal, direction);
    const bool lit = facing > 0 || (facing < 0 && scene.colors_.record(light.mesh).double_sided);
    if (!(cosine > 0) || !lit || !scene.colors_.present(light, counters)) return;
    const Vec3 origin = offset_origin(here.point, direction);
    if (shadowed(origin, offset_origin(there, -direction) - origin, kSegment)) return;
    const float light_pdf = drawn.area_density * distance2 / std::abs(facing);
    const float scattered = cosine * kInversePi;
    radiance += throughput * scene.colors_.emission<kDetail>(light, counters) *
                (scattered / light_pdf * power_heuristic(light_pdf, scattered));
  }

  void light_from_punctual(const Vertex& here, int vertex) {
    const size_t count = scene.punctual_.size();
    if (count <= PunctualLights::kEveryLight) {
      for (size_t i = 0; i < count; ++i) light_from_point(here, i, 1.0f);
      return;
    }
    const Point2 u = sobol2(path_key(key, vertex, PathDimension::punctual), index);
    float probability = 1;
    const size_t chosen = scene.punctual_.choose(u.x, &probability);
    if (probability > 0) light_from_point(here, chosen, probability);
  }

  // rho / pi E cos, looked at with some probability; weighted against connections to the light's
  // patch.
  void light_from_point(const Vertex& here, size_t index_of_light, float probability) {
    PunctualSample light;
    if (!scene.punctual_.light_at(index_of_light, here.point.position, &light)) return;
    const float cosine = dot(here.normal, light.to_light) / length(light.to_light);
    if (!(cosine > 0)) return;
    float weight = 1 / probability;
    const float beam = scene.punctual_.beam_density(index_of_light);
    if (beam > 0 && here.arrival_density > 0) {
      const float connected = beam * cosine / dot(light.to_light, light.to_light);
      weight *= power_heuristic(here.arrival_density * probability, connected);
    }
    const Vec3 origin = offset_origin(here.point, light.to_light);
    const Vec3 along =
        light.distant ? light.to_light : here.point.position + light.to_light - origin;
    if (shadowed(origin, along, light.distant ? INFINITY : 1.0f)) return;
    radiance += throughput * light.irradiance * (cosine * kInversePi * weight);
  }

  // rho / pi L cos cos' / (d^2 p_area), L being what the patch reflects of the light that lit it.
  void light_from_patches(const Vertex& here, int vertex) {
    const uint64_t dimension =
        static_cast<uint64_t>(DimensionSet::path_patch) + static_cast<uint64_t>(vertex);
    RadianceScene::Patch patch;
    if (!scene.patch(sobol4(hash_combine(key, dimension), index), counters, &patch)) return;
    const Vec3 between = patch.point.position - here.point.position;
    const float distance2 = dot(between, between);
    if (!(distance2 > 0)) return;
    const Vec3 direction = between / std::sqrt(distance2);
    const float cosine = dot(here.normal, direction), facing = -dot(patch.normal, direction);
    if (!(cosine > 0) || !(facing > 0)) return;
    const Vec3 origin = offset_origin(here.point, direction);
    if (shadowed(origin, offset_origin(patch.point, -direction) - origin, kSegment)) return;
    const float patch_pdf = patch.area_density * distance2 / facing;
    const float scattered = cosine * kInversePi;
    radiance += throughput * patch.radiance *
                (scattered / patch_pdf * power_heuristic(patch_pdf, scattered * patch.chance));
  }
};

namespace {

using Kernel = Vec3 (*)(const RadianceScene&, const Ray&, uint64_t, uint32_t, RayCounters&, float);

template <unsigned... kMasks>
constexpr std::array<Kernel, sizeof...(kMasks)> kernel_table(
    std::integer_sequence<unsigned, kMasks...>) {
  return {&PathKernel<kMasks>::run...};
}
constexpr auto kKernels =
    kernel_table(std::make_integer_sequence<unsigned, kAllRadianceBits + 1>{});

}  // namespace

RadianceScene::RadianceScene(const Tracer& tracer, const Environment* environment,
                             const LightSurvey& survey, const EffectSelection& selection,
                             unsigned mask)
    : tracer_(&tracer), selection_(selection), colors_(tracer.scene(), survey, selection) {
  if (selection.environment) environment_ = environment;
  if (environment_ != nullptr && selection.environment_sampling) {
    environment_sampler_ = std::make_unique<EnvironmentSampler>(*environment_);
    glare_ = std::make_unique<EnvironmentSampler>(*environment_,
                                                  kGlareFloor * luminance(environment_->mean));
    if (glare_->black()) glare_.reset();
  }
  if (selection.emissive && selection.emissive_sampling) {
    const auto sampler = [&](EmissiveSampler::Purpose purpose) {
      return EmissiveSampler(tracer.scene(), survey, EmissiveSampler::Shining::emissive, purpose,
                             selection.textures);
    };
    emitters_ = sampler(EmissiveSampler::Purpose::lighting);
    lamps_ = sampler(EmissiveSampler::Purpose::seeing);
  }
  if (selection.unlit) {
    unlit_ = EmissiveSampler(tracer.scene(), survey, EmissiveSampler::Shining::unlit,
                             EmissiveSampler::Purpose::seeing, selection.textures);
  }
  punctual_ = PunctualLights(tracer.scene(), survey, selection);
  kernel_ = kKernels[mask != 0 ? mask : radiance_mask(selection)];
}

}  // namespace lightkiln
