#include "core/bake/error_curve.h"

#include <algorithm>
#include <cmath>

namespace lightkiln {

double ErrorCurve::error(int doublings) const {
  if (errors.empty()) return 0;
  const int last = static_cast<int>(errors.size()) - 1;
  if (doublings <= last) return errors[static_cast<size_t>(doublings)];
  return errors.back() * std::exp2(-slope * (doublings - last));
}

double fitted_slope(std::span<const double> errors, double unknown) {
  double count = 0, mean_x = 0, mean_y = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (!(errors[i] > 0)) continue;
    ++count;
    mean_x += static_cast<double>(i);
    mean_y += std::log2(errors[i]);
  }
  if (count < 2) return unknown;
  mean_x /= count;
  mean_y /= count;
  double sxx = 0, sxy = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (!(errors[i] > 0)) continue;
    const double x = static_cast<double>(i) - mean_x;
    sxx += x * x;
    sxy += x * (std::log2(errors[i]) - mean_y);
  }
  return std::clamp(-sxy / sxx, 0.5, 1.5);
}

Stop stop_of(const ErrorCurve& curve, const std::function<double(int look)>& widening,
             double target, uint64_t fewest, uint64_t most) {
  Stop stop{curve.first_samples, 0, false};
  for (int look = 0;; ++stop.doublings, stop.samples *= 2) {
    if (stop.samples >= fewest) {
      ++look;
      const double factor = widening ? widening(look) : 1;
      if (curve.error(stop.doublings) * factor <= target) break;
    }
    if (2 * stop.samples > most) break;
  }
  stop.extrapolated = static_cast<size_t>(stop.doublings) >= curve.errors.size();
  return stop;
}

}  // namespace lightkiln
