// Source of the recurrence: see harmonics.cpp. Bernstein's inequality: Borwein & Erdelyi,
// "Polynomials and Polynomial Inequalities", 1995, theorem 5.1.4.

#include "core/sphere/harmonic_minimum.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/error.h"

namespace lightkiln {

ShBandParts::ShBandParts(const ShRgb& sh) : bands_(sh.bands) {
  double sectoral = std::sqrt(1 / (4 * kPi));
  for (int m = 0; m < bands_; ++m) {
    if (m > 0) sectoral *= std::sqrt((2.0 * m + 1) / (2.0 * m));
    sectoral_.push_back(m > 0 ? std::sqrt(2.0) * sectoral : sectoral);
    for (int l = m; l < bands_; ++l) {
      const double l2 = double(l) * l, m2 = double(m) * m, k2 = double(l - 1) * (l - 1);
      const double a = l > m ? std::sqrt((4 * l2 - 1) / (l2 - m2)) : 0.0;
      grow_.push_back(a);
      keep_.push_back(l > m + 1 ? a * std::sqrt((k2 - m2) / (4 * k2 - 1)) : 0.0);
      const Vec3d& cosine = sh.coefficients[sh_index(l, m)];
      const Vec3d sine = m > 0 ? sh.coefficients[sh_index(l, -m)] : Vec3d{};
      for (const Vec3d& c : {cosine, sine})
        coefficients_.insert(coefficients_.end(), {c.x, c.y, c.z});
    }
  }
}

void ShBandParts::evaluate(const Vec3d& direction, std::span<Vec3d> parts) const {
  assert(parts.size() >= static_cast<size_t>(bands_));
  std::fill_n(parts.begin(), bands_, Vec3d{});
  double re = 1, im = 0;  // (x + i y)^m
  size_t index = 0;
  for (int m = 0; m < bands_; ++m) {
    double before = 0, value = sectoral_[static_cast<size_t>(m)];
    for (int l = m; l < bands_; ++l, ++index) {
      if (l > m) {
        const double next = grow_[index] * direction.z * value - keep_[index] * before;
        before = value;
        value = next;
      }
      const double* c = &coefficients_[6 * index];
      const double cosine = value * re, sine = value * im;
      Vec3d& part = parts[static_cast<size_t>(l)];
      part.x += c[0] * cosine + c[3] * sine;
      part.y += c[1] * cosine + c[4] * sine;
      part.z += c[2] * cosine + c[5] * sine;
    }
    const double turned = re * direction.x - im * direction.y;
    im = re * direction.y + im * direction.x;
    re = turned;
  }
}

namespace {

ShRgb divided_by_means(const ShRgb& sh, bool present[3]) {
  ShRgb relative = sh;
  for (int channel = 0; channel < 3; ++channel) {
    const double mean = sh.coefficients[0][channel] / (2 * std::sqrt(kPi));
    double sum = 0;
    for (const Vec3d& c : sh.coefficients) sum += std::abs(c[channel]);
    present[channel] = sum > 0;
    if (!present[channel]) continue;
    if (!(mean > 0)) {
      throw Error(ErrorCode::invalid_input,
                  "Spherical harmonics whose mean radiance is not positive in every channel that "
                  "has light cannot be windowed.");
    }
    for (Vec3d& c : relative.coefficients) c[channel] /= mean;
  }
  return relative;
}

}  // namespace

RelativeField::RelativeField(const ShRgb& sh) : parts_(ShRgb(1)) {
  const ShRgb relative = divided_by_means(sh, present_);
  parts_ = ShBandParts(relative);
  spectrum_ = latlong_spectrum(relative);
  for (const Vec3d& energy : band_energy(spectrum_)) {
    band_norm_.push_back(std::sqrt(std::max({energy.x, energy.y, energy.z})));
  }
}

double RelativeField::curvature_bound(std::span<const double> factors) const {
  double sum = 0;
  for (size_t l = 0; l < band_norm_.size(); ++l) {
    const double band = static_cast<double>(l);
    sum +=
        band * band * std::abs(factors[l]) * std::sqrt((2 * band + 1) / (4 * kPi)) * band_norm_[l];
  }
  return sum;
}

namespace {

// Evaluates the smallest channel of sum_l factors[l] f_l.
class Sampler {
 public:
  Sampler(const RelativeField& field, std::span<const double> factors)
      : field_(field), factors_(factors), parts_(static_cast<size_t>(field.bands())) {}

  Vec3d rgb(const Vec3d& direction) {
    field_.parts().evaluate(direction, parts_);
    Vec3d sum;
    for (size_t l = 0; l < parts_.size(); ++l) sum += parts_[l] * factors_[l];
    return sum;
  }
  FieldPoint lowest(const Vec3d& direction) {
    const Vec3d values = rgb(direction);
    FieldPoint point{direction, 0, std::numeric_limits<double>::infinity()};
    for (int channel = 0; channel < 3; ++channel) {
      if (!field_.has_channel(channel) || !(values[channel] < point.value)) continue;
      point.channel = channel;
      point.value = values[channel];
    }
    return point;
  }

 private:
  const RelativeField& field_;
  std::span<const double> factors_;
  std::vector<Vec3d> parts_;
};

RingGrid sample_grid(const RelativeField& field, std::span<const double> factors, int threads,
                     Progress& progress) {
  const int bands = field.bands();
  const int rings = std::max(16, 4 * bands);
  const int longitudes = static_cast<int>(std::bit_ceil(static_cast<unsigned>(2 * rings)));
  return synthesise_rings(field.spectrum(), factors, rings, longitudes, threads, progress);
}

double lowest_channel(const RelativeField& field, const float* rgb, int* which) {
  double lowest = std::numeric_limits<double>::infinity();
  for (int channel = 0; channel < 3; ++channel) {
    if (!field.has_channel(channel) || !(double(rgb[channel]) < lowest)) continue;
    lowest = double(rgb[channel]);
    *which = channel;
  }
  return lowest;
}

// Points of the grid that no neighbour undercuts, ascending.
std::vector<FieldPoint> grid_minima(const RelativeField& field, const RingGrid& grid,
                                    size_t count) {
  std::vector<FieldPoint> minima;
  int unused = 0;
  for (int ring = 0; ring < grid.rings(); ++ring) {
    for (int k = 0; k < grid.longitudes(); ++k) {
      FieldPoint point;
      point.value = lowest_channel(field, grid.at(ring, k), &point.channel);
      if (minima.size() >= 4 * count && point.value > minima[4 * count - 1].value) continue;
      // The grid's margins hold the neighbours across seam and poles.
      bool lowest = true;
      for (int i = 0; i < 9 && lowest; ++i) {
        lowest =
            lowest_channel(field, grid.at(ring + i / 3 - 1, k + i % 3 - 1), &unused) >= point.value;
      }
      if (!lowest) continue;
      point.direction = grid.direction(ring, k);
      minima.push_back(point);
      if (minima.size() > 8 * count) {
        std::nth_element(minima.begin(), minima.begin() + static_cast<std::ptrdiff_t>(4 * count),
                         minima.end(),
                         [](const auto& a, const auto& b) { return a.value < b.value; });
        minima.resize(4 * count);
        std::sort(minima.begin(), minima.end(),
                  [](const auto& a, const auto& b) { return a.value < b.value; });
      }
    }
  }
  std::sort(minima.begin(), minima.end(),
            [](const auto& a, const auto& b) { return a.value < b.value; });
  if (minima.size() > count) minima.resize(count);
  return minima;
}

// Steps to the lowest of eight neighbours at a radius that is halved when none is lower.
FieldPoint descend(Sampler& sampler, FieldPoint start, double radius) {
  FieldPoint best = sampler.lowest(start.direction);
  for (double r = radius; r > 1e-5 * radius;) {
    const Basis<double> frame = make_basis(best.direction);
    FieldPoint next = best;
    for (int i = 0; i < 8; ++i) {
      const double angle = kPi / 4 * i;
      const FieldPoint point =
          sampler.lowest(normalize(frame.to_world({r * std::cos(angle), r * std::sin(angle), 1})));
      if (point.value < next.value) next = point;
    }
    if (next.value < best.value) {
      best = next;
    } else {
      r *= 0.25;
    }
  }
  return best;
}

}  // namespace

std::vector<FieldPoint> lowest_points(const RelativeField& field, std::span<const double> factors,
                                      size_t count, int threads, Progress& progress) {
  const RingGrid grid = sample_grid(field, factors, threads, progress);
  std::vector<FieldPoint> points = grid_minima(field, grid, count);
  Sampler sampler(field, factors);
  for (FieldPoint& point : points) {
    progress.check();
    point = descend(sampler, point, kPi / grid.rings());
  }
  std::sort(points.begin(), points.end(),
            [](const auto& a, const auto& b) { return a.value < b.value; });
  return points;
}

namespace {

// A cell of colatitude and longitude about +Y, by centre and half widths.
struct Cell {
  double theta, phi;
  Vec3d centre() const {
    return {std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi)};
  }
};

// The straight line in (theta, phi) from the centre to a corner has at most this length.
double cell_radius(const Cell& cell, double half_theta, double half_phi) {
  const double reach = std::min(half_theta, std::abs(kPi / 2 - cell.theta));
  const double nearest = cell.theta < kPi / 2 ? cell.theta + reach : cell.theta - reach;
  return std::hypot(half_theta, std::sin(nearest) * half_phi);
}

}  // namespace

MinimumBound bound_minimum(const RelativeField& field, std::span<const double> factors,
                           double level, double tolerance, int threads, Progress& progress) {
  const double curvature = field.curvature_bound(factors);
  // Half the tolerance is for values below `level`, half for what living cells may still hide.
  const double floor = level - 0.5 * tolerance;
  const RingGrid grid = sample_grid(field, factors, threads, progress);
  double half_theta = kPi / (2 * grid.rings()), half_phi = kPi / grid.longitudes();
  const auto excess = [&](const Cell& cell) {
    const double radius = cell_radius(cell, half_theta, half_phi);
    return 0.5 * curvature * radius * radius;
  };
  // The grid holds floats.
  const double rounding = 1e-7;
  std::vector<Cell> cells;
  double worst = 0;  // the largest excess of cells still alive
  int unused = 0;
  for (int ring = 0; ring < grid.rings(); ++ring) {
    for (int k = 0; k < grid.longitudes(); ++k) {
      const Cell cell{kPi * (ring + 0.5) / grid.rings(), 2 * kPi * k / grid.longitudes()};
      const double value = lowest_channel(field, grid.at(ring, k), &unused);
      if (value - rounding * (1 + std::abs(value)) >= floor + excess(cell)) continue;
      cells.push_back(cell);
      worst = std::max(worst, excess(cell));
    }
  }
  const double bands = field.bands();
  const size_t budget = static_cast<size_t>(std::max(4e3, 2e8 / (bands * bands + 100)));
  size_t spent = 0;
  Sampler sampler(field, factors);
  while (!cells.empty() && worst > 0.5 * tolerance) {
    progress.check();
    if (spent + 4 * cells.size() > budget) return {floor - worst, false, {}};
    spent += 4 * cells.size();
    half_theta *= 0.5;
    half_phi *= 0.5;
    std::vector<Cell> next;
    double next_worst = 0;
    for (const Cell& parent : cells) {
      for (int i = 0; i < 4; ++i) {
        const Cell cell{parent.theta + (i / 2 == 0 ? -half_theta : half_theta),
                        parent.phi + (i % 2 == 0 ? -half_phi : half_phi)};
        const FieldPoint point = sampler.lowest(cell.centre());
        if (point.value < floor) return {point.value, true, point};
        if (point.value >= floor + excess(cell)) continue;
        next.push_back(cell);
        next_worst = std::max(next_worst, excess(cell));
      }
    }
    cells = std::move(next);
    worst = next_worst;
  }
  return {cells.empty() ? floor : floor - worst, false, {}};
}

}  // namespace lightkiln
