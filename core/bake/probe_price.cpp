#include "core/bake/probe_price.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/bake/probe_cube.h"
#include "core/base/random.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

constexpr int kRounds = 4;
constexpr int kSurveyReplicates = 4;
constexpr uint64_t kSurveyPaths = kSurveyReplicates * kFirstSamples;  // a texel
constexpr int kMostCells = 64;                                        // a side
// Texels drawn over all pilot probes, and the fewest of one probe.
constexpr size_t kDrawnTexels = 512;
constexpr size_t kFewestDrawn = 96;
// The survey's share of what the order takes at the least, and its paths at the most.
constexpr double kSurveyShare = 0.25;
constexpr double kMostSurveyPaths = 1.6e6;

// The share of the sphere of the texels [x0, x1) x [y0, y1) is left to their own solid angles; a
// cell holds those from size * i / cells to size * (i + 1) / cells.
struct Cell {
  int face, x0, x1, y0, y1;
};
Cell cell_of(uint32_t number, int cells, int size) {
  const auto n = static_cast<uint32_t>(cells);
  const int face = static_cast<int>(number / (n * n)), row = static_cast<int>(number / n % n),
            column = static_cast<int>(number % n);
  return {face, size * column / cells, size * (column + 1) / cells, size * row / cells,
          size * (row + 1) / cells};
}

// Texels with the shares of the sphere that they stand for, and their own.
struct DrawnTexels {
  CubeTexels texels;
  std::vector<double> own_shares;
};

// Cells are drawn systematically, half by their share of the sphere and half by their share of the
// squared error, then a texel of the cell. A texel drawn k times of n with probability p stands for
// its share times k / (n p): the sum over what was drawn of such shares times any quantity has the
// sum over all texels as its expectation (Horvitz and Thompson, "A Generalization of Sampling
// Without Replacement From a Finite Universe", 1952).
DrawnTexels draw_texels(const CubeTexels& cells, const std::vector<double>& variances, int size,
                        size_t count, uint64_t seed) {
  double whole = 0;
  for (size_t i = 0; i < variances.size(); ++i) whole += cells.shares[i] * variances[i];
  std::map<uint32_t, double> drawn;  // weights by texel
  const double step = 1 / static_cast<double>(count);
  double next = step * static_cast<double>(to_unit_float(static_cast<uint32_t>(hash64(seed))));
  double end = 0;
  uint64_t number = 0;
  const auto share_of = [size](int x, int y) {
    return cube_texel_solid_angle(x, y, size) / (4 * kPi);
  };
  for (size_t i = 0; i < variances.size(); ++i) {
    const double by_error = whole > 0 ? cells.shares[i] * variances[i] / whole : cells.shares[i];
    const double probability = 0.5 * (cells.shares[i] + by_error);
    end += probability;
    const Cell cell = cell_of(cells.texels[i], cells.size, size);
    const int width = cell.x1 - cell.x0, height = cell.y1 - cell.y0;
    for (; next < end; next += step) {
      const uint64_t random = hash_combine(seed, ++number);
      const int x = cell.x0 + static_cast<int>(random % static_cast<uint64_t>(width));
      const int y = cell.y0 + static_cast<int>((random >> 32) % static_cast<uint64_t>(height));
      const auto texel = static_cast<uint32_t>((cell.face * size + y) * size + x);
      drawn[texel] += step * width * height / probability * share_of(x, y);
    }
  }
  DrawnTexels result;
  result.texels.size = size;
  for (const auto& [texel, share] : drawn) {
    const auto n = static_cast<uint32_t>(size);
    result.texels.texels.push_back(texel);
    result.texels.shares.push_back(share);
    result.own_shares.push_back(
        share_of(static_cast<int>(texel % n), static_cast<int>(texel / n % n)));
  }
  return result;
}

double pow2(double x) {
  return x * x;
}

// A variance v of R replicates is estimated with variance 2 v^2 / (R - 1), where the estimate's
// square has the mean v^2 (R + 1) / (R - 1): the one over the other.
constexpr double doubt_of_replicates(int replicates) {
  return 2.0 / (replicates + 1);
}

struct Survey {
  CubeTexels cells;
  std::vector<double> variances;  // of means over kFirstSamples
  double variance = 0;            // mean over the sphere
  double doubt = 0;               // squared relative standard error of `variance`
  double rays_per_path = 0;
  double seconds_per_ray = 0;
};

Survey survey_cube(const RadianceScene& scene, const ProbesState& state, uint64_t probe, int cells,
                   Progress& progress, double begin, double end) {
  Survey survey;
  survey.cells = all_texels(cells);
  CubeSampling sampling(scene, survey.cells, state.origin(probe),
                        hash_combine(state.key(kPilotStream, probe), 1),
                        state.parameters().sh.bands, state.grants.threads, kSurveyReplicates);
  const Round round = sampling.advance(progress, begin, end);
  const double paths =
      static_cast<double>(survey.cells.texels.size()) * static_cast<double>(kSurveyPaths);
  const auto rays = static_cast<double>(round.rays);
  survey.rays_per_path = rays / paths;
  double squares = 0;
  survey.seconds_per_ray = round.wall_s / std::max(rays, 1.0);
  for (size_t i = 0; i < survey.cells.texels.size(); ++i) {
    survey.variances.push_back(sampling.variance(i));
    survey.variance += survey.cells.shares[i] * survey.variances.back();
    const double part = survey.cells.shares[i] * survey.variances.back();
    squares += part * part;
  }
  if (survey.variance > 0) {
    survey.doubt = doubt_of_replicates(kSurveyReplicates) * squares / pow2(survey.variance);
  }
  return survey;
}

// What the drawn texels tell of a whole cube after one round.
struct Seen {
  double variance = 0;         // mean over the sphere, of replicates' means
  double squares = 0;          // sum over the cube of (share times variance)^2
  double doubt = 0;            // squared relative standard error of `variance`
  double replicate_doubt = 0;  // the part of it that replicates leave, drawing aside
};
Seen look_at(const CubeSampling& sampling, const DrawnTexels& drawn) {
  // The mean square of an estimate of variance from R replicates is (R + 1) / (R - 1) its square.
  constexpr double kUnbiased = (kReplicates - 1.0) / (kReplicates + 1.0);
  Seen seen;
  double by_drawing = 0, by_replicates = 0;
  for (size_t i = 0; i < drawn.own_shares.size(); ++i) {
    const double variance = sampling.variance(i), share = drawn.texels.shares[i];
    seen.variance += share * variance;
    seen.squares += kUnbiased * share * drawn.own_shares[i] * variance * variance;
    // A texel drawn with probability p < 1 stands for 1 / p, at a variance of (1 - p) of its
    // square.
    const double part = pow2(share * variance);
    by_drawing += std::max(0.0, 1 - drawn.own_shares[i] / share) * part;
    by_replicates += doubt_of_replicates(kReplicates) * part;
  }
  if (!(seen.variance > 0)) return seen;
  seen.replicate_doubt = by_replicates / pow2(seen.variance);
  seen.doubt = by_drawing / pow2(seen.variance) + seen.replicate_doubt;
  return seen;
}

ProbePilot pilot_probe(const RadianceScene& scene, const ProbesState& state, const Plan& plan,
                       uint64_t probe, int cells, size_t drawn_count, Progress& progress,
                       double begin, double end) {
  const int size = state.parameters().cubemap.size;
  const double middle = 0.5 * (begin + end);
  const Survey survey = survey_cube(scene, state, probe, cells, progress, begin, middle);
  const uint64_t key = hash_combine(state.key(kPilotStream, probe), 2);
  const DrawnTexels drawn = draw_texels(survey.cells, survey.variances, size, drawn_count, key);
  CubeSampling sampling(scene, drawn.texels, state.origin(probe), key, 0, state.grants.threads);

  ProbePilot pilot;
  pilot.curve.first_samples = uint64_t{kReplicates} * kFirstSamples;
  const double texels = 6.0 * size * size;
  // Where its cells are texels, the survey knows the first error too: by all of them, but from few
  // replicates. The curve's height is the geometric mean of both, by the inverse of their doubts.
  double height = 1, share_of_survey = 0, first_rays = 0;
  for (int k = 0; k < kRounds; ++k) {
    const uint64_t before = sampling.samples();
    const Round round = sampling.advance(progress, middle, end);
    const Seen seen = look_at(sampling, drawn);
    if (k == 0 && cells == size && seen.variance > 0 && survey.variance > 0) {
      share_of_survey = seen.doubt / (seen.doubt + survey.doubt);
      height = std::pow(survey.variance / seen.variance, share_of_survey);
    }
    pilot.curve.errors.push_back(std::sqrt(height * seen.variance / kReplicates) /
                                 plan.reference_luminance);
    const auto fresh = static_cast<double>(round.samples - before);
    const double rays = static_cast<double>(round.rays) / fresh;
    if (k == 0) first_rays = rays;
    pilot.rays.push_back(survey.rays_per_path * rays / std::max(first_rays, 1.0) * fresh * texels);
    if (!(seen.variance > 0)) continue;
    pilot.effective_texels = std::max(1.0, seen.variance * seen.variance / seen.squares);
    // The first round's height leaves the survey's share of its doubt, this round its own.
    pilot.doubt = 0.5 * std::sqrt((1 - share_of_survey) * seen.doubt + seen.replicate_doubt);
  }
  pilot.curve.slope = fitted_slope(pilot.curve.errors);
  pilot.seconds_per_ray = survey.seconds_per_ray;
  return pilot;
}

}  // namespace

double ProbePilot::rays_to(int doublings) const {
  double sum = 0, round = 0;
  for (int k = 0; k <= doublings; ++k) {
    const auto index = static_cast<size_t>(k);
    round = index < rays.size() ? rays[index] : 2 * round;
    sum += round;
  }
  return sum;
}

std::vector<ProbePilot> pilot_rounds(ProbesState& state, const Plan& plan,
                                     const std::vector<uint64_t>& probes, Progress& progress) {
  const RadianceScene& scene = state.radiance_for(plan_selection(state, plan));
  const int size = state.parameters().cubemap.size;
  const double least =
      static_cast<double>(plan.elements) * 6 * size * size * static_cast<double>(plan.min_samples);
  const double paths = std::min(kMostSurveyPaths, kSurveyShare * least);
  const double each = paths / static_cast<double>(probes.size());
  const int affordable = static_cast<int>(std::sqrt(each / (6.0 * kSurveyPaths)));
  const int cells = std::clamp(affordable, 1, std::min(size, kMostCells));
  const size_t drawn = std::max(kDrawnTexels / probes.size(), kFewestDrawn);
  std::vector<ProbePilot> pilots;
  for (size_t i = 0; i < probes.size(); ++i) {
    const auto at = [&](size_t k) {
      return 0.3 + 0.7 * static_cast<double>(k) / static_cast<double>(probes.size());
    };
    pilots.push_back(
        pilot_probe(scene, state, plan, probes[i], cells, drawn, progress, at(i), at(i + 1)));
  }
  return pilots;
}

namespace {

// A curve's height is known to within its doubt, and each doubling past its end adds to that.
constexpr double kLeastDoubt = 0.04;
constexpr double kDoubtPerDoubling = 0.05;
// The normal law's quantile of a 90 % interval.
constexpr double kNinety = 1.6449;

struct Outcome {
  double rays = 0, samples = 0;
  bool extrapolated = false;
};
Outcome outcome_of(const ProbePilot& pilot, double shift, double target, uint64_t fewest,
                   uint64_t most) {
  const CubeError law{1, pilot.effective_texels};
  const double bound = law.bound(kLookConfidence);
  const auto widening = [bound](int) { return bound; };
  Stop stop = stop_of(pilot.curve, widening, target, fewest, most);
  if (shift != 0) {
    const int beyond =
        std::max(0, stop.doublings + 1 - static_cast<int>(pilot.curve.errors.size()));
    // The bake stops by its own estimate, which is as uncertain as sixteen replicates of so many
    // texels are.
    const double luck = 0.5 * std::sqrt(2 / ((kReplicates - 1) * pilot.effective_texels));
    const double doubt =
        std::hypot(std::max(pilot.doubt, kLeastDoubt), kDoubtPerDoubling * beyond, luck);
    stop = stop_of(pilot.curve, widening, target * std::exp(-shift * doubt), fewest, most);
  }
  return {pilot.rays_to(stop.doublings), static_cast<double>(stop.samples), stop.extrapolated};
}

// What one probe takes, with the squares of what its curve leaves open below and above.
struct Leeway {
  double rays = 0, below = 0, above = 0;
};

// Low and high add, in squares, what the curves leave open for each probe and what the choice of
// pilot probes leaves open for the others.
Expected of_all(const std::vector<Leeway>& pilots, double elements) {
  RunningMoments moments;
  double below = 0, above = 0;
  for (const Leeway& pilot : pilots) {
    moments.add(pilot.rays);
    below += pilot.below;
    above += pilot.above;
  }
  const double n = static_cast<double>(pilots.size());
  const double choice = n < elements && n > 1 ? kNinety * std::sqrt(moments.variance() / n) : 0;
  return {elements * moments.mean,
          elements * std::max(0.0, moments.mean - std::hypot(std::sqrt(below) / n, choice)),
          elements * (moments.mean + std::hypot(std::sqrt(above) / n, choice))};
}

}  // namespace

// Stopping rounds samples up to a doubling, so near a doubling's edge a doubtful curve leaves two
// costs possible: the expectation over a normal law of its logarithm, by its quintiles' middles,
// lies between them.
Forecast forecast(const std::vector<ProbePilot>& pilots, uint64_t elements, double target,
                  uint64_t fewest, uint64_t most) {
  static constexpr double kMiddles[] = {-1.2816, -0.5244, 0, 0.5244, 1.2816};
  Forecast result;
  std::vector<Leeway> rays, seconds;
  for (const ProbePilot& pilot : pilots) {
    Leeway leeway;
    for (const double shift : kMiddles) {
      const Outcome outcome = outcome_of(pilot, shift, target, fewest, most);
      leeway.rays += outcome.rays / 5;
      result.samples += outcome.samples / 5 / static_cast<double>(pilots.size());
      if (shift == 0) result.extrapolated |= outcome.extrapolated;
    }
    const double low = outcome_of(pilot, -kNinety, target, fewest, most).rays;
    const double high = outcome_of(pilot, kNinety, target, fewest, most).rays;
    leeway.below = (leeway.rays - low) * (leeway.rays - low);
    leeway.above = (high - leeway.rays) * (high - leeway.rays);
    rays.push_back(leeway);
    const double pace = pilot.seconds_per_ray;
    seconds.push_back({leeway.rays * pace, leeway.below * pace * pace, leeway.above * pace * pace});
  }
  result.rays = of_all(rays, static_cast<double>(elements));
  result.seconds = of_all(seconds, static_cast<double>(elements));
  return result;
}

}  // namespace lightkiln
