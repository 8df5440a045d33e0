#include "core/environment/bright_light.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

// The angle between unit vectors with cosine c, to 2e-8: Abramowitz & Stegun 4.4.46,
// acos(x) = sqrt(1 - x) poly(x), mirrored for negative x.
double fast_acos(double c) {
  const double magnitude = std::abs(c), x = magnitude < 1 ? magnitude : 1;
  double p = -0.0012624911;
  p = p * x + 0.0066700901;
  p = p * x - 0.0170881256;
  p = p * x + 0.0308918810;
  p = p * x - 0.0501743046;
  p = p * x + 0.0889789874;
  p = p * x - 0.2145988016;
  p = p * x + 1.5707963050;
  const double angle = std::sqrt(1 - x) * p;
  return c < 0 ? kPi - angle : angle;
}

// Angles between a direction and `count` others, times `scale`. The same bits with any vector
// width.
LIGHTKILN_CLONES void find_places(const Vec3d& direction, const double* x, const double* y,
                                  const double* z, double scale, double* places, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const double cosine = x[i] * direction.x + y[i] * direction.y + z[i] * direction.z;
    places[i] = fast_acos(cosine) * scale;
  }
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

// The mean of the table over a square cell of side `extent` about each of its angles. A square has
// the same second moment extent^2 / 12 in every direction: along the angle the mean over an
// interval of that length, which also rounds the kink, and across it extent^2 / 24 cot(t) K'(t).
std::vector<double> cell_means(const std::vector<double>& table, double extent) {
  const int steps = static_cast<int>(table.size()) - 2;
  const double step = kPi / steps, half = 0.5 * extent / step;
  const auto at = [&](int i) {
    const int mirrored = i < 0 ? -i : i > steps ? 2 * steps - i : i;
    return table[static_cast<size_t>(mirrored)];
  };
  // sums[i + margin]: the integral of the interpolated table up to point i, in steps.
  const int margin = static_cast<int>(std::ceil(half)) + 2;
  std::vector<double> sums{0};
  for (int i = -margin; i < steps + margin; ++i)
    sums.push_back(sums.back() + 0.5 * (at(i) + at(i + 1)));
  const auto integral = [&](double place) {
    const int i = static_cast<int>(std::floor(place));
    const double f = place - i;
    return sums[static_cast<size_t>(i + margin)] + f * at(i) + 0.5 * f * f * (at(i + 1) - at(i));
  };
  std::vector<double> means = table;
  for (int i = 0; i <= steps; ++i) {
    const double slope = (at(i + 1) - at(i - 1)) / (2 * step), angle = step * i;
    const double bend = (at(i + 1) - 2 * at(i) + at(i - 1)) / (step * step);
    const bool pole = i == 0 || i == steps;  // where cot(t) K' tends to K''
    const double across = pole ? bend : slope / std::tan(angle);
    means[static_cast<size_t>(i)] =
        (integral(i + half) - integral(i - half)) / (2 * half) + extent * extent / 24 * across;
  }
  means.back() = means[static_cast<size_t>(steps)];
  return means;
}

// A texel acts as a point on bands l while l times its extent is small; larger ones are cut into
// this many a side, as long as the points stay few.
constexpr int kMostPoints = 384;
static_assert(kMaxBrightTexels <= kMostPoints);
constexpr double kPointPhase = 0.2;
int point_cuts(const LightStatistics& light, int bands) {
  const double most = std::sqrt(kMostPoints / static_cast<double>(light.bright.size()));
  const double wanted = std::ceil(light.bright.front().extent_rad * bands / kPointPhase);
  return static_cast<int>(std::clamp(wanted, 1.0, std::max(1.0, std::floor(most))));
}

}  // namespace

// Cells are squares of colatitude and longitude, narrowed by the sine of the colatitude; the mean
// extent of the brightest stands for all.
CutLight::CutLight(const LightStatistics& light, const ZonalKernel& kernel,
                   const std::vector<double>& responses) {
  const int cuts = point_cuts(light, static_cast<int>(responses.size()));
  for (const BrightTexel& texel : light.bright) {
    double u = 0, v = 0;
    latlong_coordinates(texel.direction, &u, &v);
    const double dv = texel.extent_rad / kPi / cuts, du = dv / 2;  // texels of a 2:1 map are square
    double all = 0;
    for (int j = 0; j < cuts; ++j) all += cuts * std::sin(kPi * (v + dv * (j + 0.5 - 0.5 * cuts)));
    for (int j = 0; j < cuts; ++j) {
      const double middle = v + dv * (j + 0.5 - 0.5 * cuts), sine = std::sin(kPi * middle);
      // A cell's centre of mass lies a little towards the equator.
      const double centre = middle + kPi * dv * dv / 12 * std::cos(kPi * middle) / sine;
      for (int i = 0; i < cuts; ++i) {
        const Vec3d direction = latlong_direction(u + du * (i + 0.5 - 0.5 * cuts), centre);
        x_.push_back(direction.x);
        y_.push_back(direction.y);
        z_.push_back(direction.z);
        energy_.push_back(texel.energy * (sine / all));
      }
    }
  }
  const BrightTexel& brightest = light.bright.front();
  const double sine2 = 1 - brightest.direction.y * brightest.direction.y;
  table_ = cell_means(cut_table(kernel, responses),
                      brightest.extent_rad / cuts * std::sqrt((1 + sine2) / 2));
}

Vec3d CutLight::at(const Vec3d& direction) const {
  const double scale = static_cast<double>(table_.size() - 2) / kPi;
  std::array<double, kMostPoints> places;
  find_places(direction, x_.data(), y_.data(), z_.data(), scale, places.data(), energy_.size());
  Vec3d sum;
  for (size_t i = 0; i < energy_.size(); ++i) {
    const size_t index = static_cast<size_t>(places[i]);
    const double f = places[i] - static_cast<double>(index);
    sum += energy_[i] * (table_[index] * (1 - f) + table_[index + 1] * f);
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
