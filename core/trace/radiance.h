#pragma once

// Radiance along a ray by unidirectional path tracing with next-event estimation.
//
// Surfaces reflect diffusely (Lambert) with the base colour as albedo, on both sides, about the
// geometric normal. Emission leaves the front, and the back too where the material is double-sided.
// Unlit surfaces show their base colour to the first ray and absorb the rest. At each vertex light
// is looked for on every light that selection samples (one point of the environment, one of the
// emitters, each punctual light); light that a scattered ray meets by itself is combined with that
// by the power heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997,
// section 9.2). Without sampling it simply counts fully, so that a furnace has no noise.
//
// What the first ray meets by itself may be smaller than the rays are apart, such as the sun, a
// small lamp or the patch that a spot light shines on. Whoever fills a cube or a sphere therefore
// looks for it too (look()) and tells sample() its own density, so that both are combined.
//
// A patch that a punctual light shines on is small and bright too when scattered rays should meet
// it: where the selection says so (punctual_patches), every vertex also connects to a point that a
// ray from the light has met, combined with the scattered ray that meets it by itself (two-vertex
// light paths of bidirectional path tracing, Veach, chapter 10).
//
// No roulette. Deep vertices are visited by fixed shares of the samples instead (see survives()):
// the count is exact within every round, so a constant stays a constant.

#include <functional>
#include <memory>

#include "core/base/random.h"
#include "core/environment/sampler.h"
#include "core/trace/effects.h"
#include "core/trace/emissive_sampler.h"
#include "core/trace/punctual.h"
#include "core/trace/surface_color.h"
#include "core/trace/tracer.h"

namespace lightkiln {

// Bits of the kernels' mask. A cleared bit removes code; a set bit whose light is absent changes
// nothing.
enum RadianceBit : unsigned {
  kEnvironmentBit = 1,
  kEnvironmentSamplingBit = 2,
  kEmissionBit = 4,
  kPunctualBit = 8,
  kSurfaceDetailBit = 16,  // textures and vertex colours
  kAllRadianceBits = 31,
};
unsigned radiance_mask(const EffectSelection& selection);

// Samples a replicate takes in its first round; rounds double what there is.
inline constexpr uint32_t kFirstSamples = 4;

// Samples come in rounds [0, 4), [4, 8), [8, 16), ... of a replicate. The one in 2^halvings that go
// on are the first of their round, an aligned block of the sequence, so that every round has its
// exact share. A round of n samples can be halved log2(n) times.
int most_halvings(uint32_t index);
bool survives(uint32_t index, int halvings);

// A shadow ray ends this share of its length before what it looks for, more than the rounding of
// its parameter at any angle that carries light; scale-free.
inline constexpr float kSegment = 1 - 0x1p-13f;

// The environment's luminance over this many times its mean is looked for directly; what is dimmer
// is left to first rays, which are better at it.
inline constexpr double kGlareFloor = 8;

// What is looked for directly, because first rays may all miss it.
enum class Sight {
  glare,    // the brightest of the environment
  lamps,    // emitters
  unlit,    // surfaces that show their base colour
  patches,  // what punctual lights shine on
};
inline constexpr Sight kSights[] = {Sight::glare, Sight::lamps, Sight::unlit, Sight::patches};
// The dimensions of its points.
DimensionSet dimensions_of(Sight sight);

// Light seen directly, from where it was looked for.
struct DirectLight {
  Vec3 direction;  // unit; meaningless where radiance is 0
  Vec3 radiance;   // 0 when hidden; weighted against the first rays that find it
};

class RadianceScene {
 public:
  // Keeps references to all but the selection. `environment` may be null. `mask` = 0 chooses the
  // kernel for the selection; otherwise the one for `mask`, which must hold all selected bits.
  RadianceScene(const Tracer& tracer, const Environment* environment, const LightSurvey& survey,
                const EffectSelection& selection, unsigned mask = 0);

  // Radiance that arrives at the origin of `ray` against its direction, which is unit. `key` names
  // the randomisation (of seed, element, replicate), `index` the sample in it.
  //
  // `first_density` > 0 is the density per steradian of first rays in this direction for each call
  // of look() for each sight there is: light that these find as well counts q^2 / (q^2 + p^2), q
  // this density and p theirs (the power heuristic, Veach, section 9.2, which leaves lights wider
  // than a texel to the texel's own even samples). Each light that they return counts as the
  // radiance of a first ray in that direction does: L / p * p^2 / (q^2 + p^2) = (L q p / (q^2 +
  // p^2)) / q.
  Vec3 sample(const Ray& ray, uint64_t key, uint32_t index, RayCounters& counters,
              float first_density = 0) const {
    return kernel_(*this, ray, key, index, counters, first_density);
  }
  // Whether there is any of it to look for; where there is none at all, sample() ignores
  // first_density.
  bool has(Sight sight) const;
  // One point of it, seen from `origin`. `density` gives first_density of a direction.
  using FirstDensity = std::function<float(const Vec3&)>;
  DirectLight look(Sight sight, const Vec3& origin, const Point4& u, const FirstDensity& density,
                   RayCounters& counters) const;

  const EffectSelection& selection() const { return selection_; }

 private:
  using Kernel = Vec3 (*)(const RadianceScene&, const Ray&, uint64_t, uint32_t, RayCounters&,
                          float);
  template <unsigned kMask>
  friend struct PathKernel;

  // A point that a beam of light has met, and what it reflects of that light.
  struct Patch {
    SurfacePoint point;
    Vec3 normal;  // towards the light
    Vec3 radiance;
    float area_density = 0;  // per normalised area
    float chance = 1;        // that a path which meets the point looks at this light
  };
  bool patch(const Point4& u, RayCounters& counters, Patch* found) const;
  DirectLight look_for_glare(const Vec3& origin, const Point4& u, const FirstDensity& density,
                             RayCounters& counters) const;
  DirectLight look_for_surface(const EmissiveSampler& shining, const Vec3& origin, const Point4& u,
                               const FirstDensity& density, RayCounters& counters) const;
  DirectLight look_for_patch(const Vec3& origin, const Point4& u, const FirstDensity& density,
                             RayCounters& counters) const;

  const Tracer* tracer_;
  const Environment* environment_ = nullptr;
  std::unique_ptr<EnvironmentSampler> environment_sampler_;
  std::unique_ptr<EnvironmentSampler> glare_;
  EffectSelection selection_;
  SurfaceColors colors_;
  EmissiveSampler emitters_;  // as surfaces look for them
  EmissiveSampler lamps_;     // as whoever sees directly does
  EmissiveSampler unlit_;
  PunctualLights punctual_;
  Kernel kernel_;
};

}  // namespace lightkiln
