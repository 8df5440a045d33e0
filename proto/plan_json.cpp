// Plans, chunk reports and accuracy records.

#include <cmath>

#include "proto/accuracy_json.h"
#include "proto/json.h"
#include "proto/json_view.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

Kind read_kind_name(const std::string& name) {
  for (const Kind kind : kKinds)
    if (name == kind_name(kind)) return kind;
  throw Error(ErrorCode::internal, "The plan is of an unknown kind \"" + name + "\".");
}

void write_counters(JsonWriter& writer, const RayCounters& counters) {
  writer.begin_object()
      .member("occlusion_rays", counters.occlusion_rays)
      .member("nearest_rays", counters.nearest_rays)
      .member("shadow_rays", counters.shadow_rays)
      .member("bounce_rays", counters.bounce_rays)
      .member("rejected_rays", counters.rejected_rays)
      .member("filter_calls", counters.filter_calls)
      .member("texture_reads", counters.texture_reads)
      .member("environment_reads", counters.environment_reads)
      .end_object();
}

RayCounters read_counters(const JsonView& view) {
  RayCounters counters;
  counters.occlusion_rays = view.count("occlusion_rays");
  counters.nearest_rays = view.count("nearest_rays");
  counters.shadow_rays = view.count("shadow_rays");
  counters.bounce_rays = view.count("bounce_rays");
  counters.rejected_rays = view.count("rejected_rays");
  counters.filter_calls = view.count("filter_calls");
  counters.texture_reads = view.count("texture_reads");
  counters.environment_reads = view.count("environment_reads");
  return counters;
}

// A chunk's round keeps the sum, so that sums over chunks are exact.
void write_chunk_round(JsonWriter& writer, const Round& round) {
  writer.begin_object()
      .member("samples", round.samples)
      .member("rays", round.rays)
      .member("elements", round.elements)
      .member("cpu_s", round.cpu_s)
      .member("wall_s", round.wall_s)
      .member("error_sum_sq", round.error_sum_sq)
      .member("error_max", round.error_max)
      .member("converged", round.converged)
      .end_object();
}

Round read_chunk_round(const JsonView& view) {
  Round round;
  round.samples = view.count("samples");
  round.rays = view.count("rays");
  round.elements = view.count("elements");
  round.cpu_s = view.number("cpu_s");
  round.wall_s = view.number("wall_s");
  round.error_sum_sq = view.number("error_sum_sq");
  round.error_max = view.number("error_max");
  round.converged = view.count("converged");
  return round;
}

}  // namespace

void write_rounds(JsonWriter& writer, const std::vector<Round>& rounds, uint64_t elements) {
  const double all = elements > 0 ? static_cast<double>(elements) : 1.0;
  writer.begin_array();
  for (const Round& round : rounds)
    writer.begin_object()
        .member("samples", round.samples)
        .member("rays", round.rays)
        .member("elements", round.elements)
        .member("cpu_s", round.cpu_s)
        .member("wall_s", round.wall_s)
        .member("error_rms", std::sqrt(round.error_sum_sq / all))
        .member("error_max", round.error_max)
        .member("converged", round.converged)
        .end_object();
  writer.end_array();
}

void write_prices(JsonWriter& writer, const std::vector<Price>& prices) {
  writer.begin_array();
  for (const Price& price : prices)
    writer.begin_object()
        .member("error", price.error)
        .member("samples", price.samples)
        .member("seconds", price.seconds)
        .member("extrapolated", price.extrapolated)
        .end_object();
  writer.end_array();
}

std::string write_plan(const Plan& plan) {
  JsonWriter writer;
  writer.begin_object()
      .member("kind", kind_name(plan.kind))
      .member("engine_version", plan.engine_version)
      .member("isa", plan.isa)
      .key("effects")
      .begin_array();
  for (const Effect& effect : plan.effects)
    writer.begin_object()
        .member("effect", effect.name)
        .member("active", effect.active)
        .member("reason", effect.reason)
        .member("bound", effect.bound)
        .end_object();
  writer.end_array().member("warnings", plan.warnings).key("repairs").begin_array();
  for (const auto& [what, count] : plan.repairs)
    writer.begin_object().member("what", what).member("count", count).end_object();
  writer.end_array()
      .member("elements", plan.elements)
      .member("element_unit", plan.element_unit)
      .key("chunks")
      .begin_array();
  for (const ElementRange& range : plan.chunks)
    writer.begin_object().member("first", range.first).member("count", range.count).end_object();
  writer.end_array()
      .member("min_samples", plan.min_samples)
      .member("max_samples", plan.max_samples)
      .member("max_bounces", plan.max_bounces)
      .member("reference_luminance", plan.reference_luminance)
      .key("prices");
  write_prices(writer, plan.prices);
  writer.member("bias_bound", plan.bias_bound)
      .member("predicted_s", plan.predicted_s)
      .member("predicted_low_s", plan.predicted_low_s)
      .member("predicted_high_s", plan.predicted_high_s)
      .member("pilot_s", plan.pilot_s)
      .end_object();
  return writer.take();
}

Plan read_plan(std::string_view json) {
  const std::string what = "The plan";
  const JsonValue value = read_trusted_json(json, ErrorCode::internal, what);
  const JsonView view(value, ErrorCode::internal, what);
  Plan plan;
  plan.kind = read_kind_name(view.text("kind"));
  plan.engine_version = view.text("engine_version");
  plan.isa = view.text("isa");
  for (const JsonValue& item : view.at("effects").items()) {
    const JsonView effect = view.view(item);
    plan.effects.push_back({effect.text("effect"), effect.boolean("active"), effect.text("reason"),
                            effect.number("bound")});
  }
  for (const JsonValue& item : view.at("warnings").items())
    plan.warnings.push_back(view.view(item).text());
  for (const JsonValue& item : view.at("repairs").items())
    plan.repairs.emplace_back(view.view(item).text("what"), view.view(item).count("count"));
  plan.elements = view.count("elements");
  plan.element_unit = view.text("element_unit");
  for (const JsonValue& item : view.at("chunks").items())
    plan.chunks.push_back({view.view(item).count("first"), view.view(item).count("count")});
  plan.min_samples = view.count("min_samples");
  plan.max_samples = view.count("max_samples");
  plan.max_bounces = view.integer("max_bounces");
  plan.reference_luminance = view.number("reference_luminance");
  for (const JsonValue& item : view.at("prices").items()) {
    const JsonView price = view.view(item);
    plan.prices.push_back({price.number("error"), price.count("samples"), price.number("seconds"),
                           price.boolean("extrapolated")});
  }
  plan.bias_bound = view.number("bias_bound");
  plan.predicted_s = view.number("predicted_s");
  plan.predicted_low_s = view.number("predicted_low_s");
  plan.predicted_high_s = view.number("predicted_high_s");
  plan.pilot_s = view.number("pilot_s");
  return plan;
}

std::string write_chunk_report(const ChunkReport& report) {
  JsonWriter writer;
  writer.begin_object().member("elements", report.elements).key("rounds").begin_array();
  for (const Round& round : report.rounds) write_chunk_round(writer, round);
  writer.end_array().key("counters");
  write_counters(writer, report.counters);
  writer.member("cpu_s", report.cpu_s)
      .member("wall_s", report.wall_s)
      .member("suspicious", report.suspicious)
      .member("budget_limited", report.budget_limited)
      .end_object();
  return writer.take();
}

ChunkReport read_chunk_report(std::string_view json) {
  const std::string what = "The chunk report";
  const JsonValue value = read_trusted_json(json, ErrorCode::internal, what);
  const JsonView view(value, ErrorCode::internal, what);
  ChunkReport report;
  report.elements = view.count("elements");
  for (const JsonValue& item : view.at("rounds").items())
    report.rounds.push_back(read_chunk_round(view.view(item)));
  report.counters = read_counters(view.at("counters"));
  report.cpu_s = view.number("cpu_s");
  report.wall_s = view.number("wall_s");
  report.suspicious = view.count("suspicious");
  report.budget_limited = view.count("budget_limited");
  return report;
}

std::string write_accuracy(const AccuracyRecord& record) {
  JsonWriter writer;
  writer.begin_object()
      .member("status", accuracy_status_name(record.status))
      .member("target_error", record.target_error)
      .member("error_unit", record.error_unit)
      .member("bias_bound", record.bias_bound)
      .member("error_rms", record.error_rms)
      .member("error_max", record.error_max)
      .member("converged_share", record.converged_share)
      .key("rounds");
  write_rounds(writer, record.rounds, record.elements);
  writer.key("time_to_error");
  write_prices(writer, record.time_to_error);
  writer.member("predicted_s", record.predicted_s)
      .member("actual_s", record.actual_s)
      .member("cpu_s", record.cpu_s)
      .member("elements", record.elements)
      .member("suspicious", record.suspicious)
      .member("budget_limited", record.budget_limited)
      .key("counters");
  write_counters(writer, record.counters);
  writer.end_object();
  return writer.take();
}

}  // namespace lightkiln
