#pragma once

// Randomised quasi-Monte Carlo: Owen-scrambled Sobol points, four dimensions a set, as a pure
// function of (seed, replicate, set, index). No state, no counter, nothing shared: neighbours never
// see each other's noise and any point can be revisited.
//
// Sources: Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020 (scrambling by hash,
// padding with shuffled indices); the hash is the corrected Laine-Karras permutation of Vegdahl,
// 2021.

#include <cstdint>

namespace lightkiln {

// A 64-bit mix (SplitMix64 finaliser); hash_combine chains it.
uint64_t hash64(uint64_t value);
uint64_t hash_combine(uint64_t seed, uint64_t value);

// The top 24 bits as a float in [0, 1): never 1, unlike value * 2^-32.
inline float to_unit_float(uint32_t bits) {
  return static_cast<float>(bits >> 8) * 0x1p-24f;
}

struct Point4 {
  float x = 0, y = 0, z = 0, w = 0;
};

// Point `index` of a scrambled four-dimensional Sobol sequence. `key` selects the randomisation:
// equal keys give one point set, different keys independent ones. Use hash_combine over (job seed,
// element, replicate, set), where sets are constants per effect. Sample counts are powers of two.
Point4 sobol4(uint64_t key, uint32_t index);

// The same point before its rounding to float: four times 32 bits.
struct SobolBits4 {
  uint32_t x = 0, y = 0, z = 0, w = 0;
};
SobolBits4 sobol4_bits(uint64_t key, uint32_t index);

// The same sequence's first two dimensions, at half the cost.
struct Point2 {
  float x = 0, y = 0;
};
Point2 sobol2(uint64_t key, uint32_t index);

// Dimension sets are constants per effect, so that switching an effect never shifts another's
// points.
enum class DimensionSet : uint64_t {
  ao_direction = 1,
  ao_shift = 2,
  probe_pixel = 16,
  probe_pilot = 17,
  probe_glare = 18,
  probe_lamp = 19,
  probe_unlit = 20,
  probe_patch = 21,
  path_base = 64,  // path_base + 4 * bounce + {0 scatter, 1 environment, 2 emissive, 3 punctual}
  path_patch = 1024,  // path_patch + bounce
};

}  // namespace lightkiln
