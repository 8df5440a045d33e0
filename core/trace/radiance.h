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
// No roulette. Deep vertices are visited by fixed shares of the samples instead (see survives()):
// the count is exact within every round, so a constant stays a constant.

#include <memory>

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

class RadianceScene {
 public:
  // Keeps references to all but the selection. `environment` may be null. `mask` = 0 chooses the
  // kernel for the selection; otherwise the one for `mask`, which must hold all selected bits.
  RadianceScene(const Tracer& tracer, const Environment* environment, const LightSurvey& survey,
                const EffectSelection& selection, unsigned mask = 0);

  // Radiance that arrives at the origin of `ray` against its direction, which is unit. `key` names
  // the randomisation (of seed, element, replicate), `index` the sample in it.
  Vec3 sample(const Ray& ray, uint64_t key, uint32_t index, RayCounters& counters) const {
    return kernel_(*this, ray, key, index, counters);
  }

  const EffectSelection& selection() const { return selection_; }

 private:
  using Kernel = Vec3 (*)(const RadianceScene&, const Ray&, uint64_t, uint32_t, RayCounters&);
  template <unsigned kMask>
  friend struct PathKernel;

  const Tracer* tracer_;
  const Environment* environment_ = nullptr;
  std::unique_ptr<EnvironmentSampler> environment_sampler_;
  EffectSelection selection_;
  SurfaceColors colors_;
  EmissiveSampler emitters_;
  PunctualLights punctual_;
  Kernel kernel_;
};

}  // namespace lightkiln
