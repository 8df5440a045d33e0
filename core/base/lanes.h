#pragma once

// Four doubles that are worked on side by side, each lane on its own: the same bits whatever the
// width of the processor's vectors.

#include <cstddef>

namespace lightkiln {

inline constexpr int kLanes = 4;

// Aligned by the struct: the vector type alone is aligned to 16 bytes in code for one instruction
// set and taken to be aligned to 32 in that for another (see instruction_sets.h).
struct alignas(32) Lanes {
  typedef double Vector __attribute__((vector_size(32)));
  Vector values;

  // Lane i, in [0, kLanes).
  double operator[](int i) const { return values[i]; }
  void set(int i, double value) { values[i] = value; }
};

static_assert(alignof(Lanes) == sizeof(Lanes));

#define LIGHTKILN_LANES [[gnu::always_inline]] inline

LIGHTKILN_LANES Lanes operator+(const Lanes& a, const Lanes& b) {
  return {a.values + b.values};
}
LIGHTKILN_LANES Lanes operator-(const Lanes& a, const Lanes& b) {
  return {a.values - b.values};
}
LIGHTKILN_LANES Lanes operator*(const Lanes& a, const Lanes& b) {
  return {a.values * b.values};
}
LIGHTKILN_LANES Lanes operator*(const Lanes& a, double b) {
  return {a.values * b};
}
LIGHTKILN_LANES Lanes operator*(double a, const Lanes& b) {
  return {a * b.values};
}
LIGHTKILN_LANES Lanes& operator+=(Lanes& a, const Lanes& b) {
  a.values += b.values;
  return a;
}

#undef LIGHTKILN_LANES

}  // namespace lightkiln
