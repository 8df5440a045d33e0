#pragma once

// What a convolution ought to give, by the plain sum over every texel in double precision: too slow
// to bake with, and therefore what a few texels of each bake are held against.

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/environment/environment.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace brute_force {

// The lobe's integral over the part of the sphere between two longitudes and two colatitudes, cut
// into cells x cells, each by two Gauss points a side. Over a cell h wide a lobe of width w errs by
// about (h / w)^4 / 4320 of its largest fourth derivative: 1e-5 at a cell of an eighth of w.
template <typename Lobe>
double integrate_lobe(const Lobe& lobe, const Vec3d& axis, double longitude_rad,
                      double colatitude_rad, double width_rad, double height_rad, int cells) {
  const double node = 0.5 / std::sqrt(3.0);
  const double width = width_rad / cells, height = height_rad / cells;
  double sum = 0;
  for (int j = 0; j < 2 * cells; ++j) {
    const double theta = colatitude_rad + (j / 2 + 0.5 + (j % 2 ? node : -node)) * height;
    const double ring = std::sin(theta), y = std::cos(theta);
    for (int i = 0; i < 2 * cells; ++i) {
      const double phi = longitude_rad + (i / 2 + 0.5 + (i % 2 ? node : -node)) * width;
      const double cosine = axis.y * y + ring * (axis.x * std::sin(phi) + axis.z * std::cos(phi));
      sum += ring * lobe(std::clamp(cosine, -1.0, 1.0));
    }
  }
  return sum * width * height / 4;
}

}  // namespace brute_force

// The lobe's average of the map about `axis`. `width_rad` is the lobe's own width. Where a texel is
// smaller than a fiftieth of the distance over which the lobe changes, its centre stands for it;
// elsewhere, on the lobe's horizon and for bright texels the lobe is integrated. Lobe:
// operator()(cosine), integrating to 1 over the sphere.
// A lobe that changes over `everywhere_rad` away from its axis too is integrated over wherever
// texels are not small against that.
template <typename Lobe>
Vec3d lobe_average(const Environment& environment, const Lobe& lobe, double width_rad,
                   const Vec3d& axis, double everywhere_rad = 1e9) {
  const Image& map = environment.radiance;
  const double step = 2 * kPi / map.width, row_step = kPi / map.height;
  const double side = std::max(step, row_step);
  constexpr double kKinkCell = 0.002;
  const double reach = 50 * side < everywhere_rad ? 50 * side - width_rad : kPi;
  const double near = reach > 0 ? std::cos(std::min(kPi, reach)) : 2;
  const double bright = 20 * luminance(environment.mean);
  std::vector<double> sine(static_cast<size_t>(map.width)), cosine(sine.size());
  for (size_t x = 0; x < sine.size(); ++x) {
    const double phi = kPi - (static_cast<double>(x) + 0.5) * step;
    sine[x] = std::sin(phi);
    cosine[x] = std::cos(phi);
  }
  Vec3d sum;
  for (int y = 0; y < map.height; ++y) {
    const double theta = (y + 0.5) * row_step, ring = std::sin(theta);
    const double along = axis.y * std::cos(theta);
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    for (int x = 0; x < map.width; ++x) {
      const size_t column = static_cast<size_t>(x);
      const double c =
          std::clamp(along + ring * (axis.x * sine[column] + axis.z * cosine[column]), -1.0, 1.0);
      double weight = omega;
      if (std::abs(c) < side) {  // the lobe's horizon, a kink, crosses it
        const int cells = std::clamp(static_cast<int>(std::ceil(side / kKinkCell)), 1, 64);
        weight = brute_force::integrate_lobe(lobe, axis, kPi - (x + 1) * step, y * row_step, step,
                                             row_step, cells);
      } else if (c > near || luminance(to_double(map.rgb(x, y))) > bright) {
        const double scale =
            std::min(width_rad + std::max(0.0, std::acos(c) - side), everywhere_rad);
        const int cells = std::clamp(static_cast<int>(std::ceil(8 * side / scale)), 1, 64);
        weight = brute_force::integrate_lobe(lobe, axis, kPi - (x + 1) * step, y * row_step, step,
                                             row_step, cells);
      } else {
        weight *= lobe(c);
      }
      sum += to_double(map.rgb(x, y)) * weight;
    }
  }
  return sum;
}

// A coefficient of the map in the frame of LatlongSpectrum: polar axis +Y, azimuth the longitude; m
// < 0 is the sine of |m|.
Vec3d projected_coefficient(const Environment& environment, int l, int m);

// The mean of the map, constant on each texel, over a texel of a cube: 200 x 200 points weighted by
// solid angle.
Vec3d texel_average(const Environment& environment, int face, int x, int y, int size);

}  // namespace lightkiln
