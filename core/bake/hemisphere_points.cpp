#include "core/bake/hemisphere_points.h"

#include <bit>
#include <cmath>

#include "core/base/error.h"
#include "core/base/random.h"

namespace lightkiln {

ReplicateMasks::ReplicateMasks(uint64_t key) {
  for (size_t r = 0; r < kPacketLanes; ++r) {
    const uint64_t first = hash64(key + 2 * r);
    const uint64_t second = hash64(key + 2 * r + 1);
    x[r] = static_cast<uint32_t>(first);
    y[r] = static_cast<uint32_t>(first >> 32);
    z[r] = static_cast<uint32_t>(second);
  }
}

namespace {

// Spreads the low 16 bits of v to the even positions.
uint32_t spread_bits(uint32_t v) {
  v &= 0xffffu;
  v = (v | v << 8) & 0x00ff00ffu;
  v = (v | v << 4) & 0x0f0f0f0fu;
  v = (v | v << 2) & 0x33333333u;
  return (v | v << 1) & 0x55555555u;
}

}  // namespace

uint32_t HemispherePoints::Block::cell_of(uint32_t px, uint32_t py) const {
  const int bits = std::countr_zero(cells);
  if (bits == 0) return 0;
  const int x_bits = (bits + 1) / 2;
  const int y_bits = bits / 2;
  const uint32_t cx = px >> (32 - x_bits);
  const uint32_t cy = y_bits == 0 ? 0 : py >> (32 - y_bits);
  // With an odd number of bits x has one more; it takes the even positions either way.
  return spread_bits(cx) | spread_bits(cy) << 1;
}

HemispherePoints::HemispherePoints(uint64_t key, uint32_t first, uint32_t last)
    : key_(key), first_(first), slots_(std::make_unique<std::array<Slot, 20>>()) {
  if (!std::has_single_bit(first) || !std::has_single_bit(last) || first > last ||
      std::countr_zero(last / first) >= 20)
    throw Error(ErrorCode::internal, "Sample counts are not powers of two in range.");
}

HemispherePoints::Block HemispherePoints::make_block(int level) const {
  const uint32_t begin = level == 0 ? 0 : first_ << (level - 1);
  Block block;
  block.cells = level == 0 ? first_ : begin;
  block.points.resize(static_cast<size_t>(block.cells) * kPacketLanes);
  for (size_t r = 0; r < kPacketLanes; ++r) {
    const uint64_t replicate_key = hash_combine(key_, r);
    for (uint32_t i = 0; i < block.cells; ++i) {
      const SobolBits4 p = sobol4_bits(replicate_key, begin + i);
      block.points[r * block.cells + block.cell_of(p.x, p.y)] = {p.x, p.y, p.z};
    }
  }
  return block;
}

const HemispherePoints::Block& HemispherePoints::block(int level) const {
  Slot& slot = (*slots_)[static_cast<size_t>(level)];
  std::call_once(slot.once, [&] { slot.block = make_block(level); });
  return slot.block;
}

CellShifts::CellShifts(const ReplicateMasks& masks, const HemispherePoints::Block& block) {
  for (size_t r = 0; r < kPacketLanes; ++r) shift[r] = block.cell_of(masks.x[r], masks.y[r]);
}

void HemispherePoints::Block::read(uint32_t cell, const ReplicateMasks& masks,
                                   const CellShifts& shifts, CellPoints* out) const {
  for (size_t r = 0; r < kPacketLanes; ++r) {
    const Point& p = points[r * cells + (cell ^ shifts.shift[r])];
    out->x[r] = p.x ^ masks.x[r];
    out->y[r] = p.y ^ masks.y[r];
    out->z[r] = p.z ^ masks.z[r];
  }
}

namespace {

// The centre of the 2^-23 interval that holds the point, mapped from (0, 1) to (-1, 1): never 0,
// never the border, exactly representable.
float centred(uint32_t bits) {
  return (static_cast<float>(static_cast<int32_t>(bits >> 9)) + 0.5f) * 0x1p-22f - 1.0f;
}

// Shirley and Chiu, "A Low Distortion Map Between Disk and Square", Journal of Graphics Tools
// 2(3), 1997: squares about the centre become circles. With a the coordinate of larger magnitude
// and b the other,
//   r = a,   phi = (pi / 4) b / a,   the a axis gets r cos(phi), the b axis r sin(phi).
// |phi| <= pi / 4, where the Taylor series below err by less than 3e-9.
struct Disk {
  float x, y, r2;
};
inline Disk concentric(float u, float v) {
  const bool u_larger = std::fabs(u) > std::fabs(v);
  const float a = u_larger ? u : v;
  const float b = u_larger ? v : u;
  const float phi = 0.78539816f * (b / a);
  const float q = phi * phi;
  const float sine =
      phi *
      (1 + q * (-1.6666667e-1f + q * (8.3333333e-3f + q * (-1.9841270e-4f + q * 2.7557319e-6f))));
  const float cosine =
      1 + q * (-0.5f + q * (4.1666667e-2f + q * (-1.3888889e-3f + q * 2.4801587e-5f)));
  const float along = a * cosine;
  const float across = a * sine;
  return {u_larger ? along : across, u_larger ? across : along, a * a};
}

}  // namespace

// Malley's method: a uniform point of the disk, lifted to the hemisphere, has density cos / pi.
void cosine_hemisphere(const CellPoints& points, float x[kPacketLanes], float y[kPacketLanes],
                       float z[kPacketLanes]) {
  for (size_t i = 0; i < kPacketLanes; ++i) {
    const Disk disk = concentric(centred(points.x[i]), centred(points.y[i]));
    x[i] = disk.x;
    y[i] = disk.y;
    z[i] = std::sqrt(1 - disk.r2);
  }
}

// Height is uniform on a uniform sphere (Archimedes): z = 1 - r^2 for a uniform point of the disk,
// and the radius sqrt(1 - z^2) = r sqrt(2 - r^2).
void uniform_hemisphere(const CellPoints& points, float x[kPacketLanes], float y[kPacketLanes],
                        float z[kPacketLanes]) {
  for (size_t i = 0; i < kPacketLanes; ++i) {
    const Disk disk = concentric(centred(points.x[i]), centred(points.y[i]));
    const float stretch = std::sqrt(2 - disk.r2);
    x[i] = disk.x * stretch;
    y[i] = disk.y * stretch;
    z[i] = 1 - disk.r2;
  }
}

}  // namespace lightkiln
