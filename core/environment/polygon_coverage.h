#pragma once

// Exact areas that a small polygon covers of the texels of a grid.

#include <cstddef>
#include <vector>

namespace lightkiln {

struct GridPoint {
  double x = 0, y = 0;
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
  // Area of the polygon inside texel (x, y), in [0, 1] up to rounding.
  double area(int x, int y) const {
    return areas_[static_cast<size_t>(y - top_) * static_cast<size_t>(columns_ + 2) +
                  static_cast<size_t>(x - left_)];
  }

 private:
  void add_edge(GridPoint from, GridPoint to);

  int left_ = 0, top_ = 0, columns_ = 0, rows_ = 0;
  std::vector<double> areas_;
};

}  // namespace lightkiln
