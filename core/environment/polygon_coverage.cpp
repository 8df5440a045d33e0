// By Green's theorem a texel's covered area is a sum over the edges: an edge that falls by dy
// within a row covers dy of every texel to its right, and of the texels that it crosses the part to
// its right. Each edge adds the differences of that from texel to texel; one running sum along the
// row turns them into areas (R. Levien, "Inside the fastest font renderer in the world", 2016,
// after the signed-area buffers of FreeType).

#include "core/environment/polygon_coverage.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

void PolygonCoverage::add_edge(GridPoint a, GridPoint b) {
  if (a.y == b.y) return;
  const double sign = a.y < b.y ? 1 : -1;
  if (sign < 0) std::swap(a, b);
  const double slope = (b.x - a.x) / (b.y - a.y);
  double x = a.x;
  const int first = static_cast<int>(a.y), last = std::min(static_cast<int>(b.y), rows_ - 1);
  for (int row = first; row <= last; ++row) {
    const double dy = std::min(row + 1.0, b.y) - std::max(static_cast<double>(row), a.y);
    if (dy <= 0) continue;
    const double end = x + slope * dy;
    double* line = &areas_[static_cast<size_t>(row) * static_cast<size_t>(columns_ + 2)];
    const double left = std::clamp(std::min(x, end), 0.0, static_cast<double>(columns_));
    const double right = std::clamp(std::max(x, end), 0.0, static_cast<double>(columns_));
    const int from = static_cast<int>(left), to = static_cast<int>(right);
    const double height = sign * dy;
    // What lies right of the edge in texel k, less what lies right of it in texel k - 1.
    double before = 0;
    for (int k = from; k <= to; ++k) {
      double covered = 0;
      if (from == to) {
        covered = 1 - (0.5 * (left + right) - k);
      } else {
        // The edge is at `left`.. within the texel: its part right of the edge, over the span.
        const double low = std::max(left, static_cast<double>(k)), high = std::min(right, k + 1.0);
        const double span = right - left;
        covered = (low - left) / span + (high - low) / span * (1 - (0.5 * (low + high) - k));
      }
      line[k] += height * (covered - before);
      before = covered;
    }
    line[to + 1] += height * (1 - before);
    x = end;
  }
}

void PolygonCoverage::cover(const GridPoint* points, size_t count) {
  double low_x = points[0].x, high_x = low_x, low_y = points[0].y, high_y = low_y;
  double twice_area = 0;
  for (size_t i = 0; i < count; ++i) {
    const GridPoint &p = points[i], &next = points[(i + 1) % count];
    low_x = std::min(low_x, p.x);
    high_x = std::max(high_x, p.x);
    low_y = std::min(low_y, p.y);
    high_y = std::max(high_y, p.y);
    twice_area +=
        (p.x - points[0].x) * (next.y - points[0].y) - (next.x - points[0].x) * (p.y - points[0].y);
  }
  left_ = static_cast<int>(std::floor(low_x));
  top_ = static_cast<int>(std::floor(low_y));
  columns_ = static_cast<int>(std::floor(high_x)) - left_ + 1;
  rows_ = static_cast<int>(std::floor(high_y)) - top_ + 1;
  if (columns_ == 1 && rows_ == 1) {
    areas_.assign(3, std::abs(0.5 * twice_area));
    return;
  }
  areas_.assign(static_cast<size_t>(rows_) * static_cast<size_t>(columns_ + 2), 0);
  for (size_t i = 0; i < count; ++i) {
    const GridPoint &p = points[i], &next = points[(i + 1) % count];
    add_edge({p.x - left_, p.y - top_}, {next.x - left_, next.y - top_});
  }
  // Falling edges on the left cover what lies right of them: the sign of one orientation.
  const double sign = twice_area > 0 ? -1 : 1;
  for (int row = 0; row < rows_; ++row) {
    double* line = &areas_[static_cast<size_t>(row) * static_cast<size_t>(columns_ + 2)];
    double sum = 0;
    for (int k = 0; k < columns_ + 2; ++k) {
      sum += line[k];
      line[k] = sign * sum;
    }
  }
}

}  // namespace lightkiln
