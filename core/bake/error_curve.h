#pragma once

// The one model of how errors fall with samples, and of where a stopping rule ends on it. Plans
// predict by it, records extrapolate by it.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace lightkiln {

// Errors seen after first_samples, and after each doubling; past the last they fall like N^-slope.
struct ErrorCurve {
  uint64_t first_samples = 1;
  std::vector<double> errors;
  double slope = 0.5;

  double error(int doublings) const;  // 0 when none was seen
};

// The slope of log(error) against -log(samples) over successive doublings, by least squares, kept
// within what randomised quasi-Monte Carlo can do: 0.5 for independent noise, 1.5 for smooth
// integrands. `unknown` where fewer than two errors are above 0.
double fitted_slope(std::span<const double> errors, double unknown = 0.5);

struct Stop {
  uint64_t samples = 0;
  int doublings = 0;
  bool extrapolated = false;  // past the errors that were seen
};

// Where doublings end that look from `fewest` samples on, stop at the k-th look once error times
// widening(k) is within `target`, and never pass `most`. `widening` null = 1.
Stop stop_of(const ErrorCurve& curve, const std::function<double(int look)>& widening,
             double target, uint64_t fewest, uint64_t most);

}  // namespace lightkiln
