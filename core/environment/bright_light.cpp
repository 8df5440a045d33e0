#include "core/environment/bright_light.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

// The angle between unit vectors with cosine c, to 2e-8: Abramowitz & Stegun 4.4.46,
// acos(x) = sqrt(1 - x) poly(x), mirrored for negative x.
double fast_acos(double c) {
  const double x = std::min(std::abs(c), 1.0);
  double p = -0.0012624911;
  for (const double k : {0.0066700901, -0.0170881256, 0.0308918810, -0.0501743046, 0.0889789874,
                         -0.2145988016, 1.5707963050}) {
    p = p * x + k;
  }
  const double angle = std::sqrt(1 - x) * p;
  return c < 0 ? kPi - angle : angle;
}

constexpr int kTableStepsPerBand = 32;

// What the band limit cuts off the lobe: K(t) - sum_{l<L} (2l+1)/(4 pi) h_l P_l(cos t), at equal
// steps of the angle from 0 to pi. An even number of steps puts the kink at pi/2 on a point.
std::vector<double> cut_table(const ZonalKernel& kernel, const std::vector<double>& responses) {
  const int steps = kTableStepsPerBand * static_cast<int>(responses.size());
  std::vector<double> table(static_cast<size_t>(steps) + 2);
  for (int i = 0; i <= steps; ++i) {
    const double angle = kPi * i / steps, z = std::cos(angle);
    double before = 0, value = 1, sum = 0;
    for (size_t l = 0; l < responses.size(); ++l) {
      const double degree = static_cast<double>(l);
      if (l > 0) {
        const double next = ((2 * degree - 1) * z * value - (degree - 1) * before) / degree;
        before = value;
        value = next;
      }
      sum += (2 * degree + 1) / (4 * kPi) * responses[l] * value;
    }
    table[static_cast<size_t>(i)] = kernel.at_angle(angle) - sum;
  }
  table.back() = table[static_cast<size_t>(steps)];
  return table;
}

// A texel acts as a point on bands l while l times its extent is small; larger ones are cut into
// this many a side, as long as the points stay few.
constexpr double kMaxPoints = 384;
constexpr double kPointPhase = 0.2;
int point_cuts(const LightStatistics& light, int bands) {
  const double most = std::sqrt(kMaxPoints / static_cast<double>(light.bright.size()));
  const double wanted = std::ceil(light.bright.front().extent_rad * bands / kPointPhase);
  return static_cast<int>(std::clamp(wanted, 1.0, std::max(1.0, std::floor(most))));
}

}  // namespace

CutLight::CutLight(const LightStatistics& light, const ZonalKernel& kernel,
                   const std::vector<double>& responses)
    : table_(cut_table(kernel, responses)) {
  const int cuts = point_cuts(light, static_cast<int>(responses.size()));
  for (const BrightTexel& texel : light.bright) {
    double u = 0, v = 0;
    latlong_coordinates(texel.direction, &u, &v);
    const double dv = texel.extent_rad / kPi, du = dv / 2;  // texels of a 2:1 map are square
    for (int j = 0; j < cuts; ++j) {
      for (int i = 0; i < cuts; ++i) {
        const Vec3d direction =
            latlong_direction(u + du * ((i + 0.5) / cuts - 0.5), v + dv * ((j + 0.5) / cuts - 0.5));
        points_.push_back({direction, texel.energy / (cuts * cuts)});
      }
    }
  }
}

Vec3d CutLight::at(const Vec3d& direction) const {
  const double scale = static_cast<double>(table_.size() - 2) / kPi;
  Vec3d sum;
  for (const PointSource& point : points_) {
    const double place = fast_acos(dot(point.direction, direction)) * scale;
    const size_t index = static_cast<size_t>(place);
    const double f = place - static_cast<double>(index);
    sum += point.energy * (table_[index] * (1 - f) + table_[index + 1] * f);
  }
  return sum;
}

// Bright texels stand as points of extent s: band l of a box differs from a point's by at most
// min(1, (l s)^2 / 24) of it. Taken as if all their energy E were one source, whose squared norm in
// band l is E^2 (2l+1) / (4 pi). Beyond the computed bands only even ones are left, which fall as
// l^-2.5; past sixteen times as many, the sum's rest is an integral.
double cut_light_bound(const LightStatistics& light, const std::vector<double>& responses,
                       int bands) {
  const double extent = light.bright.front().extent_rad / point_cuts(light, bands);
  const auto term = [&](double l, double response) {
    const double miss = std::min(1.0, l * l * extent * extent / 24) * response;
    return (2 * l + 1) * miss * miss;
  };
  double sum = 0;
  for (size_t l = static_cast<size_t>(bands); l < responses.size(); ++l) {
    sum += term(static_cast<double>(l), responses[l]);
  }
  const double count = static_cast<double>(responses.size());
  const double last = std::max(std::abs(responses.back()), std::abs(responses.end()[-2]));
  double l = count;
  for (; l < 16 * count; l += 2) sum += term(l, last * std::pow(l / count, -2.5));
  sum += last * last * std::pow(l / count, -5) * l * l / 3;
  return light.bright_share * std::sqrt(sum);
}

}  // namespace lightkiln
