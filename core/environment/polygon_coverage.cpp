// By Green's theorem what a polygon covers of a texel is a sum over its edges: an edge that falls
// by dv within a row covers, of every texel to its right, the whole width over dv, and of the
// texels that it crosses the part to its right. Each edge adds the differences of that from texel
// to texel; one running sum along the row turns them into integrals (R. Levien, "Inside the fastest
// font renderer in the world", 2016, after the signed-area buffers of FreeType; here with moments).
//
// Right of an edge u = X(v) in a texel lies, at height v, the interval [X, 1/2], so that the
// integrals over v are of
//   1: 1/2 - X     u: (1/4 - X^2) / 2     v: v (1/2 - X)     u v: v (1/4 - X^2) / 2     v^2: ...
//   u^2: (1/8 - X^3) / 3
// All are cubic in v at most, and Simpson's rule is exact. Over the whole width they are 1, 0, v,
// 0, v^2 and 1/12.

#include "core/environment/polygon_coverage.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

namespace {

void add_scaled(const CoveredMoments& moments, double scale, CoveredMoments* sum) {
  sum->area += scale * moments.area;
  sum->u += scale * moments.u;
  sum->v += scale * moments.v;
  sum->uv += scale * moments.uv;
  sum->vv += scale * moments.vv;
  sum->uu += scale * moments.uu;
}

// Right of the edge from (x0, v0) to (x1, v1), both from the texel's centre; height |v1 - v0|.
CoveredMoments right_of(double x0, double v0, double x1, double v1) {
  const double vs[3] = {v0, 0.5 * (v0 + v1), v1}, xs[3] = {x0, 0.5 * (x0 + x1), x1};
  const double height = std::abs(v1 - v0);
  const double weights[3] = {height / 6, 4 * height / 6, height / 6};
  CoveredMoments sum;
  for (int i = 0; i < 3; ++i) {
    const double width = weights[i] * (0.5 - xs[i]);
    const double first = width * 0.5 * (0.5 + xs[i]);
    sum.area += width;
    sum.u += first;
    sum.v += vs[i] * width;
    sum.uv += vs[i] * first;
    sum.vv += vs[i] * vs[i] * width;
    sum.uu += width * (0.25 + xs[i] * (0.5 + xs[i])) / 3;
  }
  return sum;
}

CoveredMoments whole_width(double v0, double v1) {
  const double height = std::abs(v1 - v0);
  return {height,     0, height * 0.5 * (v0 + v1), 0, height * (v0 * v0 + v0 * v1 + v1 * v1) / 3,
          height / 12};
}

}  // namespace

void PolygonCoverage::add_edge(GridPoint a, GridPoint b) {
  if (a.y == b.y) return;
  const double sign = a.y < b.y ? 1 : -1;
  if (sign < 0) std::swap(a, b);
  const double slope = (b.x - a.x) / (b.y - a.y);
  double x = a.x;
  const int first = static_cast<int>(a.y), last = std::min(static_cast<int>(b.y), rows_ - 1);
  for (int row = first; row <= last; ++row) {
    const double begin = std::max(static_cast<double>(row), a.y), finish = std::min(row + 1.0, b.y);
    const double dy = finish - begin;
    if (dy <= 0) continue;
    const double end = x + slope * dy;
    CoveredMoments* line = &texels_[static_cast<size_t>(row) * static_cast<size_t>(columns_ + 2)];
    const double middle = row + 0.5;
    // From left to right, whichever way the edge leans.
    double left = std::clamp(x, 0.0, static_cast<double>(columns_)), left_v = begin - middle;
    double right = std::clamp(end, 0.0, static_cast<double>(columns_)), right_v = finish - middle;
    if (left > right) {
      std::swap(left, right);
      std::swap(left_v, right_v);
    }
    const int from = static_cast<int>(left), to = static_cast<int>(right);
    const double rise = right > left ? (right_v - left_v) / (right - left) : 0;
    // What lies right of the edge in texel k holds the part of the edge in k, and the whole width
    // over what lies left of k. Running sums carry whole widths on; the rest is taken off again.
    for (int k = from; k <= to; ++k) {
      const double low = std::max(left, static_cast<double>(k)), high = std::min(right, k + 1.0);
      const double low_v = k == from ? left_v : left_v + rise * (low - left);
      const double high_v = k == to ? right_v : left_v + rise * (high - left);
      const double centre = k + 0.5;
      const CoveredMoments part = right_of(low - centre, low_v, high - centre, high_v);
      add_scaled(part, sign, &line[k]);
      CoveredMoments carried = whole_width(low_v, high_v);
      add_scaled(carried, sign, &line[k + 1]);
      add_scaled(part, -sign, &line[k + 1]);
    }
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
  texels_.assign(static_cast<size_t>(rows_) * static_cast<size_t>(columns_ + 2), {});
  for (size_t i = 0; i < count; ++i) {
    const GridPoint &p = points[i], &next = points[(i + 1) % count];
    add_edge({p.x - left_, p.y - top_}, {next.x - left_, next.y - top_});
  }
  // Falling edges on the left cover what lies right of them: the sign of one orientation.
  const double sign = twice_area > 0 ? -1 : 1;
  for (int row = 0; row < rows_; ++row) {
    CoveredMoments* line = &texels_[static_cast<size_t>(row) * static_cast<size_t>(columns_ + 2)];
    CoveredMoments sum;
    for (int k = 0; k < columns_ + 2; ++k) {
      add_scaled(line[k], 1, &sum);
      line[k] = {};
      add_scaled(sum, sign, &line[k]);
    }
  }
}

}  // namespace lightkiln
