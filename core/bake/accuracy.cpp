#include "core/bake/accuracy.h"

#include <algorithm>
#include <cmath>

#include "core/bake/bake.h"
#include "core/bake/error_curve.h"

namespace lightkiln {

const char* accuracy_status_name(AccuracyStatus status) {
  switch (status) {
    case AccuracyStatus::converged:
      return "converged";
    case AccuracyStatus::budget_limited:
      return "budget_limited";
    case AccuracyStatus::suspicious:
      return "suspicious";
    case AccuracyStatus::exact:
      return "exact";
  }
  return "";
}

const char* probe_status_name(ProbeStatus status) {
  switch (status) {
    case ProbeStatus::valid:
      return "valid";
    case ProbeStatus::inside_geometry:
      return "inside_geometry";
    case ProbeStatus::on_surface:
      return "on_surface";
  }
  return "";
}

namespace {

// Adds one chunk's round `index`; past its last round a chunk's elements keep their last errors.
void add_round(const ChunkReport& report, size_t index, Round& total) {
  if (report.rounds.empty()) {
    total.converged += report.elements;
    return;
  }
  const bool took_part = index < report.rounds.size();
  const Round& round = took_part ? report.rounds[index] : report.rounds.back();
  total.error_sum_sq += round.error_sum_sq;
  total.error_max = std::max(total.error_max, round.error_max);
  total.converged += round.converged;
  if (!took_part) return;
  total.samples = std::max(total.samples, round.samples);
  total.rays += round.rays;
  total.elements += round.elements;
  total.cpu_s += round.cpu_s;
  total.wall_s += round.wall_s;
}

double rms_error(const Round& round, uint64_t elements) {
  return elements == 0 ? 0 : std::sqrt(round.error_sum_sq / static_cast<double>(elements));
}

}  // namespace

std::vector<Round> sum_rounds(const std::vector<ChunkReport>& reports) {
  size_t count = 0;
  for (const ChunkReport& report : reports) count = std::max(count, report.rounds.size());
  std::vector<Round> rounds(count);
  for (size_t i = 0; i < count; ++i)
    for (const ChunkReport& report : reports) add_round(report, i, rounds[i]);
  return rounds;
}

AccuracyRecord summarise_accuracy(const std::vector<ChunkReport>& reports, double target_error,
                                  double predicted_s, const std::string& error_unit) {
  AccuracyRecord record;
  record.target_error = target_error;
  record.error_unit = error_unit;
  record.predicted_s = predicted_s;
  for (const ChunkReport& report : reports) {
    record.elements += report.elements;
    record.suspicious += report.suspicious;
    record.budget_limited += report.budget_limited;
    record.counters += report.counters;
    record.cpu_s += report.cpu_s;
    record.actual_s += report.wall_s;
  }
  record.rounds = sum_rounds(reports);
  if (!record.rounds.empty()) {
    const Round& last = record.rounds.back();
    record.error_rms = rms_error(last, record.elements);
    record.error_max = last.error_max;
    record.converged_share = record.elements == 0 ? 1
                                                  : static_cast<double>(last.converged) /
                                                        static_cast<double>(record.elements);
  } else {
    record.converged_share = 1;
  }
  const bool nothing_sampled = std::all_of(record.rounds.begin(), record.rounds.end(),
                                           [](const Round& round) { return round.rays == 0; });
  record.status = record.suspicious > 0       ? AccuracyStatus::suspicious
                  : record.budget_limited > 0 ? AccuracyStatus::budget_limited
                  : nothing_sampled           ? AccuracyStatus::exact
                                              : AccuracyStatus::converged;
  record.time_to_error = price_errors(record.rounds, record.elements);
  return record;
}

namespace {

// y = intercept + slope x by least squares.
struct Line {
  double intercept = 0, slope = 0;
};
Line fit_line(const std::vector<std::pair<double, double>>& points) {
  double mean_x = 0, mean_y = 0;
  for (const auto& [x, y] : points) {
    mean_x += x / static_cast<double>(points.size());
    mean_y += y / static_cast<double>(points.size());
  }
  double sxx = 0, sxy = 0;
  for (const auto& [x, y] : points) {
    sxx += (x - mean_x) * (x - mean_x);
    sxy += (x - mean_x) * (y - mean_y);
  }
  const double slope = sxx > 0 ? sxy / sxx : 0;
  return {mean_y - slope * mean_x, slope};
}

// What the rounds say of error and time as functions of the samples an element takes, from those
// in which every element took part (later ones show how stopping works, not how sampling does).
// Time is linear: t0 + b N with t0 >= 0, b > 0.
struct Model {
  ErrorCurve curve;
  Line time;
};

Model fit_model(const std::vector<Round>& rounds, uint64_t elements) {
  Model model;
  model.curve.first_samples = std::max<uint64_t>(rounds.front().samples, 1);
  std::vector<std::pair<double, double>> times;
  double wall_s = 0;
  for (const Round& round : rounds) {
    wall_s += round.wall_s;
    if (!times.empty() && round.elements < elements) break;
    times.emplace_back(static_cast<double>(round.samples), wall_s);
    model.curve.errors.push_back(rms_error(round, elements));
  }
  model.curve.slope = fitted_slope(model.curve.errors);
  const auto& [samples, seconds] = times.back();
  if (times.size() >= 2) model.time = fit_line(times);
  if (times.size() < 2 || model.time.slope <= 0 || model.time.intercept < 0)
    model.time = {0, seconds / std::max(samples, 1.0)};
  return model;
}

}  // namespace

std::vector<Price> price_errors(const std::vector<Round>& rounds, uint64_t elements) {
  std::vector<Price> prices;
  if (rounds.empty() || elements == 0) {
    for (const double error : kQuotedErrors) prices.push_back({error, 0, 0, false});
    return prices;
  }
  const Model model = fit_model(rounds, elements);
  for (const double error : kQuotedErrors) {
    Price price{error, 0, 0, true};
    double wall_s = 0;
    for (const Round& round : rounds) {
      wall_s += round.wall_s;
      if (rms_error(round, elements) <= error) {
        price = {error, round.samples, wall_s, false};
        break;
      }
    }
    if (price.extrapolated) {
      const uint64_t least = 2 * rounds.back().samples;
      price.samples = stop_of(model.curve, nullptr, error, least, uint64_t{1} << 50).samples;
      price.seconds = std::max(
          wall_s, model.time.intercept + model.time.slope * static_cast<double>(price.samples));
    }
    prices.push_back(price);
  }
  return prices;
}

}  // namespace lightkiln
