#pragma once

// What a small polygon covers of the texels of a grid: exact areas and moments.

#include <cstddef>
#include <vector>

namespace lightkiln {

struct GridPoint {
  double x = 0, y = 0;
};

// Integrals over the covered part of a texel of 1, u, v, u v, v^2 and u^2, where (u, v) runs from
// the texel's centre, -1/2 to 1/2.
struct CoveredMoments {
  double area = 0, u = 0, v = 0, uv = 0, vv = 0, uu = 0;
};

class PolygonCoverage {
 public:
  // Takes a simple polygon of either orientation. The border texels of its bounding box are
  // left()..right() and top()..bottom(), all inclusive.
  void cover(const GridPoint* points, size_t count);

  int left() const { return left_; }
  int right() const { return left_ + columns_ - 1; }
  int top() const { return top_; }
  int bottom() const { return top_ + rows_ - 1; }
  // Of texel (x, y); areas in [0, 1] up to rounding.
  const CoveredMoments& moments(int x, int y) const {
    return texels_[static_cast<size_t>(y - top_) * static_cast<size_t>(columns_ + 2) +
                   static_cast<size_t>(x - left_)];
  }
  double area(int x, int y) const { return moments(x, y).area; }

 private:
  void add_edge(GridPoint from, GridPoint to);

  int left_ = 0, top_ = 0, columns_ = 0, rows_ = 0;
  std::vector<CoveredMoments> texels_;
};

}  // namespace lightkiln
