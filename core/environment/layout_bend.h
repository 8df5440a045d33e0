#pragma once

// What a conversion misplaces by taking the edges of a cell's outline for straight, and the share
// of smoothing over it for even.

#include "core/environment/layout_gather.h"

namespace lightkiln {

// How far the middle of each edge lies off the middle of its ends, in source texels; `target`: in
// the target's, likewise top, right, bottom, left.
struct CellBends {
  GridPoint top, right, bottom, left;
  std::array<GridPoint, 4> target;
};

// The outline through the middles of the edges, and the place at shares (s, t) of the cell.
std::array<GridPoint, 8> bent_border(const CellOutline& outline, const CellBends& bends);
GridPoint bent_place(const CellOutline& outline, const CellBends& bends, double s, double t);

// Shares of the cell's weights.
struct Misplaced {
  double among_texels = 0;     // from one texel of the source to the next
  double between_samples = 0;  // of an interpolation, shifted
  double within = 0;           // from one end of the cell to the other
};
// `left` of the bends is not followed: 1 = straight edges, 1/4 = edges through their middles.
Misplaced misplaced_by(const CellOutline& outline, const CellBends& bends, double left);

// The share of smoothing where a texel of the target spans so many of the source (layout_truth.h).
double smooth_share(double span);

// That share over a cell: linear in the source's picture.
struct SmoothShare {
  double middle = 0, along_x = 0, along_y = 0;
  GridPoint centre;
  // Between the ends of the two pairs of sides, by which a linear share is drawn.
  double first_step = 0, second_step = 0;

  double at(double x, double y) const;
  bool none() const { return middle == 0 && along_x == 0 && along_y == 0; }
  bool full() const { return middle == 1 && along_x == 0 && along_y == 0; }
};
SmoothShare smooth_share_over(const CellOutline& outline, const CellBends& bends);

}  // namespace lightkiln
