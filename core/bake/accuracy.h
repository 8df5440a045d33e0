#pragma once

// What accuracy cost: rounds of sampling, predictions, and what became of them.

#include <cstdint>
#include <string>
#include <vector>

#include "core/trace/tracer.h"

namespace lightkiln {

// Errors at which prices are quoted, in the unit of target_error.
inline constexpr double kQuotedErrors[] = {0.1, 0.03, 0.01, 0.003, 0.001};

// One doubling, over all elements that took part.
struct Round {
  uint64_t samples = 0;   // per element (per texel for probes) so far
  uint64_t rays = 0;      // traced in this round, all elements
  uint64_t elements = 0;  // that took part in this round
  double cpu_s = 0;       // spent in this round
  double wall_s = 0;
  // Estimated error over ALL elements after this round (elements that stopped earlier keep theirs):
  double error_sum_sq =
      0;  // sum of squared 95 % half-widths; rms = sqrt(error_sum_sq / all elements)
  double error_max = 0;
  uint64_t converged = 0;  // elements at or under the target
};

// Facts of a chunk that are not part of its bytes: times differ from run to run.
struct ChunkReport {
  uint64_t elements = 0;
  std::vector<Round> rounds;  // index = number of doublings
  RayCounters counters;
  double cpu_s = 0;
  double wall_s = 0;
  uint64_t suspicious = 0;      // elements whose variance estimate cannot be trusted
  uint64_t budget_limited = 0;  // elements that ran out of samples
};

// A price: what reaching `error` would take. Those of a plan are predictions, scaled up from the
// pilot's elements to all; those of an accuracy record are measured unless extrapolated. `samples`
// is what the error needs, not what this order allows: above the plan's max_samples the order
// itself ends budget_limited before it.
struct Price {
  double error = 0;
  uint64_t samples = 0;       // per element; their mean where elements stop one by one
  double seconds = 0;         // wall seconds with the granted threads
  bool extrapolated = false;  // some element needs more rounds than were run; from fitted slopes
};

enum class AccuracyStatus { converged, budget_limited, suspicious, exact };
const char* accuracy_status_name(AccuracyStatus status);

struct AccuracyRecord {
  AccuracyStatus status = AccuracyStatus::converged;
  double target_error = 0;
  std::string error_unit;  // e.g. "95 % half-width of openness, absolute"
  double bias_bound = 0;   // what was left out takes at the most, see Plan; 0 = nothing was
  double error_rms = 0;    // over elements
  double error_max = 0;
  double converged_share = 0;
  std::vector<Round> rounds;         // summed over chunks
  std::vector<Price> time_to_error;  // for kQuotedErrors
  double predicted_s = 0;            // for the order, by the plan
  double actual_s = 0;               // baking, wall, summed over chunks
  double cpu_s = 0;
  uint64_t elements = 0;
  uint64_t suspicious = 0;
  uint64_t budget_limited = 0;
  RayCounters counters;
};

// Rounds of parts baked side by side, summed by index in the order given; a part that stopped after
// k rounds carries its last errors into later ones.
std::vector<Round> sum_rounds(const std::vector<ChunkReport>& reports);

// Sums reports in chunk order: rounds by index, a chunk that stopped after k rounds carries its
// last errors into later ones.
AccuracyRecord summarise_accuracy(const std::vector<ChunkReport>& reports, double target_error,
                                  double predicted_s, const std::string& error_unit);

// Fits log(error) = a - beta log(samples) over the rounds and reads prices off it, with
// time = t0 + b * samples; a round that reached the error is quoted as measured. What no round
// reached costs at least one round more than the last. The error is the rms of the elements'
// half-widths.
std::vector<Price> price_errors(const std::vector<Round>& rounds, uint64_t elements);

}  // namespace lightkiln
