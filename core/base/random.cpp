#include "core/base/random.h"

#include <array>
#include <cstddef>

namespace lightkiln {

namespace {

// Direction numbers of Sobol dimensions 1 to 3 (dimension 0 is plain bit reversal), from the
// primitive polynomials and initial values of Joe and Kuo, "Constructing Sobol Sequences with
// Better Two-Dimensional Projections", SIAM J. Sci. Comput. 30(5), 2008, set new-joe-kuo-6. With a
// polynomial of degree s and coefficients a, v_k for k >= s obeys
//   v_k = a_1 v_{k-1} ^ ... ^ a_{s-1} v_{k-s+1} ^ v_{k-s} ^ (v_{k-s} >> s).
struct Polynomial {
  int degree;
  uint32_t inner_coefficients;
  uint32_t initial[3];
};
constexpr Polynomial kPolynomials[3] = {{1, 0, {1, 0, 0}}, {2, 1, {1, 3, 0}}, {3, 1, {1, 3, 1}}};

constexpr std::array<uint32_t, 32> direction_numbers(const Polynomial& p) {
  std::array<uint32_t, 32> v{};
  for (int k = 0; k < 32; ++k) {
    const auto at = static_cast<size_t>(k);
    if (k < p.degree) {
      v[at] = p.initial[k] << (31 - k);
      continue;
    }
    const uint32_t oldest = v[static_cast<size_t>(k - p.degree)];
    v[at] = oldest ^ (oldest >> p.degree);
    for (int j = 1; j < p.degree; ++j)
      if (p.inner_coefficients >> (p.degree - 1 - j) & 1u) v[at] ^= v[static_cast<size_t>(k - j)];
  }
  return v;
}

// The matrix product one byte of the index at a time: [byte position][byte value][dimension - 1].
using ByteTable = std::array<std::array<std::array<uint32_t, 3>, 256>, 4>;
constexpr ByteTable make_byte_table() {
  ByteTable table{};
  for (size_t dimension = 0; dimension < 3; ++dimension) {
    const auto v = direction_numbers(kPolynomials[dimension]);
    for (size_t position = 0; position < 4; ++position)
      for (size_t value = 1; value < 256; ++value) {
        size_t lowest = 0;
        while ((value >> lowest & 1u) == 0) ++lowest;
        table[position][value][dimension] =
            table[position][value & (value - 1)][dimension] ^ v[8 * position + lowest];
      }
  }
  return table;
}
constexpr ByteTable kSobol = make_byte_table();

uint32_t sobol_dimension(uint32_t index, size_t dimension) {
  const size_t d = dimension - 1;
  return kSobol[0][index & 255u][d] ^ kSobol[1][index >> 8 & 255u][d] ^
         kSobol[2][index >> 16 & 255u][d] ^ kSobol[3][index >> 24][d];
}

uint32_t reverse_bits(uint32_t x) {
  x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
  x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
  x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
  return __builtin_bswap32(x);
}

// Each bit is flipped by a hash of the bits below it: an Owen scramble of the bit-reversed number.
// Every step keeps that property: x ^= x * even, x += seed and x *= odd let a bit depend on lower
// bits only.
uint32_t permute_reversed(uint32_t x, uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

uint32_t owen_scramble(uint32_t x, uint32_t seed) {
  return reverse_bits(permute_reversed(reverse_bits(x), seed));
}

// Five seeds from one key: the index shuffle and four dimensions.
struct Seeds {
  uint64_t a, b, c;
  explicit Seeds(uint64_t key)
      : a(hash64(key)),
        b(hash64(key ^ 0x6a09e667f3bcc908u)),
        c(hash64(key ^ 0xbb67ae8584caa73bu)) {}
  uint32_t shuffle() const { return static_cast<uint32_t>(a); }
  uint32_t x() const { return static_cast<uint32_t>(a >> 32); }
  uint32_t y() const { return static_cast<uint32_t>(b); }
  uint32_t z() const { return static_cast<uint32_t>(b >> 32); }
  uint32_t w() const { return static_cast<uint32_t>(c); }
};

}  // namespace

// Steele, Lea, Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014: the increment
// keeps zero from being a fixed point.
uint64_t hash64(uint64_t value) {
  value += 0x9e3779b97f4a7c15u;
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9u;
  value = (value ^ value >> 27) * 0x94d049bb133111ebu;
  return value ^ value >> 31;
}

uint64_t hash_combine(uint64_t seed, uint64_t value) {
  return hash64(seed ^ hash64(value));
}

SobolBits4 sobol4_bits(uint64_t key, uint32_t index) {
  const Seeds seeds(key);
  const uint32_t shuffled = owen_scramble(index, seeds.shuffle());
  // Dimension 0 is the reversed index, so its two reversals cancel.
  return {reverse_bits(permute_reversed(shuffled, seeds.x())),
          owen_scramble(sobol_dimension(shuffled, 1), seeds.y()),
          owen_scramble(sobol_dimension(shuffled, 2), seeds.z()),
          owen_scramble(sobol_dimension(shuffled, 3), seeds.w())};
}

Point4 sobol4(uint64_t key, uint32_t index) {
  const SobolBits4 bits = sobol4_bits(key, index);
  return {to_unit_float(bits.x), to_unit_float(bits.y), to_unit_float(bits.z),
          to_unit_float(bits.w)};
}

Point2 sobol2(uint64_t key, uint32_t index) {
  const Seeds seeds(key);
  const uint32_t shuffled = owen_scramble(index, seeds.shuffle());
  return {to_unit_float(reverse_bits(permute_reversed(shuffled, seeds.x()))),
          to_unit_float(owen_scramble(sobol_dimension(shuffled, 1), seeds.y()))};
}

}  // namespace lightkiln
