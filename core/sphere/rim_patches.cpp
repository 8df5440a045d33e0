#include "core/sphere/rim_patches.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

// In one quadrant of the unit disc, 0 <= x0 < x1 and 0 <= y0 < y1.
struct Rectangle {
  double x0, x1, y0, y1;
};

// phi where a circle crosses a side.
double crossing(const RimPatch::Side& side, double radius) {
  const double other = std::sqrt(std::max(0.0, (radius - side.at) * (radius + side.at)));
  return side.vertical ? std::atan2(other, side.at) : std::atan2(side.at, other);
}

// Along a circle in the quadrant x falls and y rises: it enters a rectangle through the right side
// or the lower one, whichever it passes last, and leaves it through the left or the upper one.
// Which it is changes at the radii of the corners.
void add_patches(const MapLayout& layout, const Rectangle& r, double sign_x, double sign_y,
                 std::vector<RimPatch>* patches) {
  std::array<double, 4> radii = {std::hypot(r.x0, r.y0), std::hypot(r.x1, r.y0),
                                 std::hypot(r.x0, r.y1), std::hypot(r.x1, r.y1)};
  std::sort(radii.begin(), radii.end());
  const RimPatch::Side left{true, r.x0}, right{true, r.x1}, lower{false, r.y0}, upper{false, r.y1};
  constexpr double kNothing = 1e-12;
  for (size_t i = 0; i < 3; ++i) {
    const double inner = radii[i], outer = std::min(1.0, radii[i + 1]);
    if (outer - inner < kNothing) continue;
    const double middle = 0.5 * (inner + outer);
    const bool by_right = middle > r.x1 && crossing(right, middle) > crossing(lower, middle);
    const bool by_upper = middle > r.y1 && crossing(upper, middle) < crossing(left, middle);
    patches->push_back({radial_angle(layout, inner), radial_angle(layout, outer),
                        by_right ? right : lower, by_upper ? upper : left, sign_x, sign_y});
  }
}

struct Arc {
  double theta, radius, first, range;
};
Arc arc_at(const MapLayout& layout, const RimPatch& patch, double b) {
  const double theta = patch.inner_rad + b * (patch.outer_rad - patch.inner_rad);
  const double radius = std::min(1.0, radial_radius(layout, theta));
  const double first = crossing(patch.first, radius);
  return {theta, radius, first, std::max(0.0, crossing(patch.last, radius) - first)};
}

}  // namespace

std::vector<RimPatch> rim_patches(const MapLayout& layout, int x, int y) {
  std::vector<RimPatch> patches;
  if (!is_radial(layout.kind)) return patches;
  const double texel = 2.0 / layout.width;
  const double x0 = x * texel - 1, x1 = (x + 1) * texel - 1;
  const double y0 = 1 - (y + 1) * texel, y1 = 1 - y * texel;
  const double margin = layout.kind == LayoutKind::mirror_ball ? 3 : 1;
  if (std::hypot(std::max(-x0, x1), std::max(-y0, y1)) <= 1 - margin * texel) return patches;
  for (const double sign_x : {1.0, -1.0}) {
    const double a = sign_x > 0 ? x0 : -x1, b = sign_x > 0 ? x1 : -x0;
    for (const double sign_y : {1.0, -1.0}) {
      const double c = sign_y > 0 ? y0 : -y1, d = sign_y > 0 ? y1 : -y0;
      if (b <= 0 || d <= 0) continue;
      add_patches(layout, {std::max(0.0, a), b, std::max(0.0, c), d}, sign_x, sign_y, &patches);
    }
  }
  return patches;
}

RimPoint rim_point(const MapLayout& layout, const RimPatch& patch, double a, double b) {
  const Arc arc = arc_at(layout, patch, b);
  const double phi = arc.first + a * arc.range;
  const double right = patch.sign_x * std::cos(phi), up = patch.sign_y * std::sin(phi);
  return {radial_direction_at(layout, right, up, arc.theta),
          0.5 * layout.width * (1 + arc.radius * right),
          0.5 * layout.width * (1 - arc.radius * up)};
}

double rim_density(const MapLayout& layout, const RimPatch& patch, double b) {
  const Arc arc = arc_at(layout, patch, b);
  return (patch.outer_rad - patch.inner_rad) * arc.range * std::sin(arc.theta);
}

// Where a side is tangent to the inner circle the arc grows as a square root, which b = b1 s^2
// takes out.
double rim_solid_angle(const MapLayout& layout, const RimPatch& patch, double a0, double a1,
                       double b0, double b1) {
  const double node = std::sqrt(0.15);  // of three Gauss points, from the middle
  constexpr double kWeights[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double s = 0.5 + (k - 1) * node;
    sum += b0 == 0 ? kWeights[k] * 2 * s * rim_density(layout, patch, b1 * s * s)
                   : kWeights[k] * rim_density(layout, patch, b0 + (b1 - b0) * s);
  }
  return sum * (a1 - a0) * (b1 - b0);
}

}  // namespace lightkiln
