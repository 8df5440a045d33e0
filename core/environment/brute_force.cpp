#include "core/environment/brute_force.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/sphere/direction_map.h"
#include "core/sphere/quadrature.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

// A texel is a box: along its row cos(m phi) integrates to (2/m) sin(m s/2) cos(m phi_centre), and
// across it Gauss points of P_lm sin(theta) are exact to the last digit when there are eight, and
// as many more as radians of the band that a row spans. The standard library's Y_lm(theta, 0)
// carries the Condon-Shortley phase, which is taken off.
Vec3d projected_coefficient(const Environment& environment, int l, int m) {
  const Image& map = environment.radiance;
  const GaussRule rule = gauss_legendre(8 + static_cast<int>((l + 1) * kPi / map.height));
  const int order = std::abs(m);
  const double step = 2 * kPi / map.width, row_step = kPi / map.height;
  const double box = order > 0 ? 2 * std::sin(order * step / 2) / order : step;
  const double scale = (order % 2 == 1 ? -1.0 : 1.0) * (order > 0 ? std::sqrt(2.0) : 1.0) * box;
  std::vector<double> wave(static_cast<size_t>(map.width));
  for (size_t x = 0; x < wave.size(); ++x) {
    const double phi = kPi - (static_cast<double>(x) + 0.5) * step;
    wave[x] = m < 0 ? std::sin(order * phi) : std::cos(order * phi);
  }
  Vec3d sum;
  for (int y = 0; y < map.height; ++y) {
    double height = 0;
    for (size_t k = 0; k < rule.nodes.size(); ++k) {
      const double theta = (y + 0.5 + 0.5 * rule.nodes[k]) * row_step;
      height += 0.5 * row_step * rule.weights[k] * std::sin(theta) *
                std::sph_legendre(static_cast<unsigned>(l), static_cast<unsigned>(order), theta);
    }
    Vec3d row;
    for (size_t x = 0; x < wave.size(); ++x) {
      row += to_double(map.rgb(static_cast<int>(x), y)) * wave[x];
    }
    sum += row * (height * scale);
  }
  return sum;
}

namespace {

struct Stretch {
  double from, to;  // colatitudes
};

// The part of the meridian at a longitude, (sin t sin phi, cos t, sin t cos phi), in front of every
// plane. In front of n it is a sin t + b cos t >= 0, a = n.x sin phi + n.z cos phi, b = n.y: up to
// or from the angle atan2(|b|, -a sign b), as b is above or below 0.
Stretch inside(const std::array<Vec3d, 4>& planes, double phi) {
  Stretch kept{0, kPi};
  for (const Vec3d& n : planes) {
    const double a = n.x * std::sin(phi) + n.z * std::cos(phi), b = n.y;
    if (b > 0)
      kept.to = std::min(kept.to, std::atan2(b, -a));
    else if (b < 0)
      kept.from = std::max(kept.from, std::atan2(-b, a));
    else if (a < 0)
      kept.to = -1;
  }
  return kept;
}

// The longitudes of a texel about that of its centre: of its corners, unless the pole is inside.
Stretch longitudes(const std::array<Vec3d, 4>& corners, const Vec3d& centre, bool pole) {
  if (pole) return {-kPi, kPi};
  Stretch result{kPi, -kPi};
  const double middle = std::atan2(centre.x, centre.z);
  for (const Vec3d& corner : corners) {
    if (std::hypot(corner.x, corner.z) < 1e-12) continue;
    const double offset = std::remainder(std::atan2(corner.x, corner.z) - middle, 2 * kPi);
    result = {std::min(result.from, offset), std::max(result.to, offset)};
  }
  return {middle + result.from, middle + result.to};
}

}  // namespace

// Solid angle is d(longitude) d(cos theta): a meridian stands for its share of a column, and a
// row's part of it for a difference of cos theta.
Vec3d texel_average(const Environment& environment, int face, int x, int y, int size,
                    int meridians) {
  const Image& map = environment.radiance;
  const auto corner = [&](int i, int j) {
    return environment.pending.undo(
        cube_direction(face, double(x + i) / size, double(y + j) / size));
  };
  const std::array<Vec3d, 4> corners = {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
  const Vec3d centre = environment.pending.undo(cube_texel_direction(face, x, y, size));
  std::array<Vec3d, 4> planes;
  bool pole = true;
  for (size_t i = 0; i < 4; ++i) {
    planes[i] = cross(corners[i], corners[(i + 1) % 4]);
    if (dot(planes[i], centre) < 0) planes[i] = planes[i] * -1.0;
    if (std::abs(planes[i].y) < 1e-14) planes[i].y = 0;  // a meridian
    pole = pole && planes[i].y * centre.y > 0;
  }
  const Stretch reach = longitudes(corners, centre, pole);
  const double step = 2 * kPi / map.width, row_step = kPi / map.height;
  Vec3d sum;
  double all = 0;
  // Columns count against longitude: column i spans [pi - (i + 1) step, pi - i step].
  const int first = static_cast<int>(std::floor((kPi - reach.to) / step));
  const int last = static_cast<int>(std::floor((kPi - reach.from) / step));
  for (int i = first; i <= last; ++i) {
    const int column = ((i % map.width) + map.width) % map.width;
    const double to = std::min(reach.to, kPi - i * step);
    const double from = std::max(reach.from, kPi - (i + 1) * step);
    for (int k = 0; k < meridians && to > from; ++k) {
      const double width = (to - from) / meridians;
      const Stretch kept = inside(planes, from + (k + 0.5) * width);
      for (int row = std::max(0, static_cast<int>(kept.from / row_step));
           row < map.height && row * row_step < kept.to; ++row) {
        const double top = std::max(kept.from, row * row_step);
        const double bottom = std::min(kept.to, (row + 1) * row_step);
        if (bottom <= top) continue;
        const double omega =
            2 * width * std::sin(0.5 * (top + bottom)) * std::sin(0.5 * (bottom - top));
        sum += to_double(map.rgb(column, row)) * omega;
        all += omega;
      }
    }
  }
  return sum / all;
}

}  // namespace lightkiln
