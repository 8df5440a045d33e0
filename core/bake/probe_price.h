#pragma once

// What samples of a probe bring and cost, measured before the bake, and what an order will take.
//
// A cube's error hangs on few texels: rims of lamps, a sun's reflection. So every texel (of large
// cubes every cell of texels) is sampled a little, which tells the error at the fewest samples and
// the time of a path; then texels drawn by how noisy they were found are sampled through the first
// rounds, which tells how error and cost go on from there.

#include <cstdint>
#include <vector>

#include "core/bake/error_curve.h"
#include "core/bake/probes_state.h"

namespace lightkiln {

struct ProbePilot {
  // Root mean square over the sphere of the texels' errors, relative to plan.reference_luminance.
  ErrorCurve curve;
  double effective_texels = 1;  // as CubeError has it
  double doubt = 0;             // relative standard error of the curve's height
  std::vector<double> rays;     // of each round of the cube; the last one's double from there
  double seconds_per_ray = 0;   // wall

  double rays_to(int doublings) const;  // of all rounds up to there
};

// One for each of `probes`, sampled as `plan` orders.
std::vector<ProbePilot> pilot_rounds(ProbesState& state, const Plan& plan,
                                     const std::vector<uint64_t>& probes, Progress& progress);

// An expectation, given the pilot's doubt, and a 90 % interval.
struct Expected {
  double value = 0, low = 0, high = 0;
};

// What all `elements` take when each stops by the rule, `target` left for noise.
struct Forecast {
  Expected rays;              // work: the same on every machine
  Expected seconds;           // the same at the pace of the pilot
  double samples = 0;         // a texel, their mean over probes
  bool extrapolated = false;  // some probe needs more rounds than the pilot ran
};
Forecast forecast(const std::vector<ProbePilot>& pilots, uint64_t elements, double target,
                  uint64_t fewest, uint64_t most);

}  // namespace lightkiln
