#include "core/sphere/harmonic_window.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/sphere/harmonic_minimum.h"

namespace lightkiln {

namespace {

// What counts as not negative, relative to the channel's mean.
constexpr double kTolerance = 1e-6;

std::vector<double> quantity_factors(ShQuantity quantity, int bands) {
  std::vector<double> factors;
  for (int l = 0; l < bands; ++l) {
    factors.push_back(quantity == ShQuantity::radiance ? 1.0 : clamped_cosine_band(l) / kPi);
  }
  return factors;
}

std::vector<double> times(std::span<const double> a, std::span<const double> b) {
  std::vector<double> product;
  for (size_t i = 0; i < a.size(); ++i) product.push_back(a[i] * b[i]);
  return product;
}

std::vector<double> negated(std::vector<double> factors) {
  for (double& factor : factors) factor = -factor;
  return factors;
}

}  // namespace

std::vector<double> hann_factors(int bands) {
  std::vector<double> factors;
  for (int l = 0; l < bands; ++l) factors.push_back(0.5 * (1 + std::cos(kPi * l / bands)));
  return factors;
}

std::vector<double> lanczos_factors(int bands) {
  std::vector<double> factors = {1.0};
  for (int l = 1; l < bands; ++l) {
    const double x = kPi * l / bands;
    factors.push_back(std::sin(x) / x);
  }
  return factors;
}

std::vector<double> sloan_factors(int bands, double lambda) {
  std::vector<double> factors;
  for (int l = 0; l < bands; ++l) {
    const double laplacian = double(l) * (l + 1);
    factors.push_back(1 / (1 + lambda * laplacian * laplacian));
  }
  return factors;
}

namespace {

// The bands of the reconstruction at one direction and channel.
using BandValues = std::vector<double>;

double filtered(const BandValues& bands, double lambda) {
  double sum = 0;
  for (size_t l = 0; l < bands.size(); ++l) {
    const double laplacian = static_cast<double>(l) * (static_cast<double>(l) + 1);
    sum += bands[l] / (1 + lambda * laplacian * laplacian);
  }
  return sum;
}

bool none_negative(const std::vector<BandValues>& points, double lambda) {
  return std::all_of(points.begin(), points.end(),
                     [&](const BandValues& bands) { return filtered(bands, lambda) >= 0; });
}

// The smallest lambda >= `from` at which no point is negative, in steps of a tenth and then by
// bisection to the last bit. The means are 1, so a large lambda always does.
double smallest_lambda(const std::vector<BandValues>& points, double from) {
  if (none_negative(points, from)) return from;
  double low = from, high = std::max(from * 1.1, 1e-12);
  while (!none_negative(points, high)) {
    low = high;
    high *= 1.1;
  }
  for (double middle = 0.5 * (low + high); low < middle && middle < high;
       middle = 0.5 * (low + high)) {
    (none_negative(points, middle) ? high : low) = middle;
  }
  return high;
}

struct MinimalLambda {
  double lambda = 0;
  double proven = 0;
  std::vector<FieldPoint> met;  // every point that was negative on the way
};

ShRgb truncated(const ShRgb& sh, int bands) {
  ShRgb few(bands);
  std::copy_n(sh.coefficients.begin(), few.coefficients.size(), few.coefficients.begin());
  return few;
}

// The exchange method of semi-infinite programming: a lambda must serve infinitely many directions.
// Keep the few that were ever negative, take the smallest lambda that serves those, look for the
// lowest points under it, and add them. Every lambda met is a lower bound of the answer; the last
// one serves the whole sphere. Where few bands are negative many are so nearby: their points are a
// cheap beginning.
MinimalLambda minimal_lambda(const ShRgb& sh, ShQuantity quantity, int threads,
                             Progress& progress) {
  constexpr size_t kPoints = 12;
  constexpr int kRounds = 100, kFewBands = 12;
  MinimalLambda result;
  if (sh.bands > kFewBands) {
    const ShRgb few = truncated(sh, std::max(kFewBands, sh.bands / 3));
    result.met = minimal_lambda(few, quantity, threads, progress).met;
  }
  const RelativeField field(sh);
  const std::vector<double> weights = quantity_factors(quantity, sh.bands);
  std::vector<BandValues> points;
  std::vector<Vec3d> parts(weights.size());
  const auto keep = [&](const FieldPoint& point) {
    field.parts().evaluate(point.direction, parts);
    BandValues bands;
    for (size_t l = 0; l < parts.size(); ++l) {
      bands.push_back(parts[l][point.channel] * weights[l]);
    }
    points.push_back(std::move(bands));
  };
  for (const FieldPoint& point : result.met) keep(point);
  if (!points.empty()) result.lambda = smallest_lambda(points, 0);
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<double> factors = times(weights, sloan_factors(sh.bands, result.lambda));
    std::vector<FieldPoint> lowest = lowest_points(field, factors, kPoints, threads, progress);
    if (lowest.front().value >= -kTolerance) {
      const MinimumBound bound = bound_minimum(field, factors, 0, kTolerance, threads, progress);
      result.proven = bound.bound;
      if (!bound.refuted || bound.found.value >= -kTolerance) return result;
      lowest = {bound.found};
    }
    for (const FieldPoint& point : lowest) {
      keep(point);
      result.met.push_back(point);
    }
    result.lambda = smallest_lambda(points, result.lambda);
  }
  throw Error(ErrorCode::internal, "The search for the smallest window did not end.");
}

ShExtremes measure_extremes(const RelativeField& field, const RelativeField& luminance_field,
                            std::span<const double> factors, int threads, Progress& progress) {
  const std::vector<double> copy(factors.begin(), factors.end());
  ShExtremes extremes;
  extremes.lowest = lowest_points(field, copy, 2, threads, progress).front().value;
  if (luminance_field.empty()) return extremes;
  extremes.luminance_min = lowest_points(luminance_field, copy, 2, threads, progress).front().value;
  extremes.luminance_max =
      -lowest_points(luminance_field, negated(copy), 2, threads, progress).front().value;
  return extremes;
}

ShRgb luminance_alone(const ShRgb& sh) {
  ShRgb grey(sh.bands);
  for (size_t i = 0; i < sh.coefficients.size(); ++i) {
    grey.coefficients[i].x = luminance(sh.coefficients[i]);
  }
  return grey;
}

double energy_above_zero(const ShRgb& sh) {
  double sum = 0;
  for (size_t i = 1; i < sh.coefficients.size(); ++i)
    sum += dot(sh.coefficients[i], sh.coefficients[i]);
  return sum;
}

}  // namespace

WindowedSh window_sh(const ShRgb& radiance, ShWindow window, ShQuantity quantity, int threads,
                     Progress& progress) {
  WindowedSh result;
  result.sh = radiance;
  ShWindowReport& report = result.report;
  report.window = window;
  report.quantity = quantity;
  report.factors.assign(static_cast<size_t>(radiance.bands), 1.0);
  if (window == ShWindow::none) return result;
  if (window == ShWindow::hann) report.factors = hann_factors(radiance.bands);
  if (window == ShWindow::lanczos) report.factors = lanczos_factors(radiance.bands);
  const double energy = energy_above_zero(radiance);
  if (!(energy > 0)) {
    if (luminance(radiance.coefficients[0]) > 0) report.before = report.after = {1, 1, 1};
    return result;
  }
  const RelativeField field(radiance);
  const RelativeField grey(luminance_alone(radiance));
  const std::vector<double> weights = quantity_factors(quantity, radiance.bands);
  if (window == ShWindow::minimal) {
    const MinimalLambda minimal = minimal_lambda(radiance, quantity, threads, progress);
    report.lambda = minimal.lambda;
    report.proven_lowest = minimal.proven;
    report.factors = sloan_factors(radiance.bands, minimal.lambda);
  }
  result.sh = sh_convolve(radiance, report.factors);
  report.before = measure_extremes(field, grey, weights, threads, progress);
  report.after = measure_extremes(field, grey, times(weights, report.factors), threads, progress);
  const double contrast = report.before.luminance_max - report.before.luminance_min;
  report.energy_removed = 1 - energy_above_zero(result.sh) / energy;
  if (contrast > 0) {
    report.contrast_removed =
        1 - (report.after.luminance_max - report.after.luminance_min) / contrast;
  }
  return result;
}

}  // namespace lightkiln
