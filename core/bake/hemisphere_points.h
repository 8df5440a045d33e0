#pragma once

// The points behind openness: one scrambled Sobol net a replicate, shared by all elements and
// randomised anew for each by exclusive-or.
//
// Why this is sound: an Owen-scrambled net shifted digitally (every coordinate xor a uniform
// 32-bit mask) is again a net with uniform points, so an element's sixteen replicate means are
// unbiased and, since each has masks of its own, independent. Different elements have different
// masks, so their errors are independent too.
//
// Why it is fast: a shift maps dyadic cells onto dyadic cells. Points are stored by the cell of
// the unit square that they lie in; packet c takes, from every replicate, the one point whose
// shifted place is cell c. The sixteen rays of a packet therefore leave in nearly the same
// direction, and no point is computed twice.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace lightkiln {

inline constexpr size_t kPacketLanes = 16;

// Per replicate, the masks of an element's three dimensions.
struct ReplicateMasks {
  std::array<uint32_t, kPacketLanes> x{}, y{}, z{};
  ReplicateMasks() = default;
  explicit ReplicateMasks(uint64_t key);
};

// One cell's points, lane = replicate, as 32-bit fractions of 1.
struct CellPoints {
  alignas(64) uint32_t x[kPacketLanes];
  alignas(64) uint32_t y[kPacketLanes];
  alignas(64) uint32_t z[kPacketLanes];
};

struct CellShifts;

class HemispherePoints {
 public:
  // Points 0 .. last of every replicate, in blocks [0, first), [first, 2 first), [2 first, 4
  // first), ... Both counts are powers of two. Blocks are made when first asked for.
  HemispherePoints(uint64_t key, uint32_t first, uint32_t last);

  struct Point {
    uint32_t x, y, z;
  };
  struct Block {
    uint32_t cells = 0;         // = points of each replicate in this block
    std::vector<Point> points;  // [replicate * cells + cell]

    void read(uint32_t cell, const ReplicateMasks& masks, const CellShifts& shifts,
              CellPoints* out) const;
    // Which of `cells` equal cells of the unit square holds (x, y), in Morton order.
    uint32_t cell_of(uint32_t x, uint32_t y) const;
  };
  const Block& block(int level) const;

 private:
  Block make_block(int level) const;

  struct Slot {
    std::once_flag once;
    Block block;
  };
  uint64_t key_;
  uint32_t first_;
  std::unique_ptr<std::array<Slot, 20>> slots_;
};

// The cells that the masks exchange: lane r reads cell (c xor shift[r]) to land in cell c.
struct CellShifts {
  std::array<uint32_t, kPacketLanes> shift;
  CellShifts(const ReplicateMasks& masks, const HemispherePoints::Block& block);
};

// Unit directions about +Z for the points' (x, y), with density cos(theta) / pi. z > 0.
void cosine_hemisphere(const CellPoints& points, float x[kPacketLanes], float y[kPacketLanes],
                       float z[kPacketLanes]);
// The same with density 1 / (2 pi).
void uniform_hemisphere(const CellPoints& points, float x[kPacketLanes], float y[kPacketLanes],
                        float z[kPacketLanes]);

}  // namespace lightkiln
