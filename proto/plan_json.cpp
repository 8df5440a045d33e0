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

// A list of members serves both directions: the writer's and the reader's.
template <typename T, typename Members>
void write_members(JsonWriter& writer, const T& message, const Members& members) {
  members(message, [&](const char* name, const auto& value) { writer.member(name, value); });
}

struct MemberReader {
  const JsonView& view;

  void operator()(const char* name, uint64_t& value) const { value = view.count(name); }
  void operator()(const char* name, double& value) const { value = view.number(name); }
  void operator()(const char* name, bool& value) const { value = view.boolean(name); }
  void operator()(const char* name, std::string& value) const { value = view.text(name); }
};
template <typename T, typename Members>
T read_members(const JsonView& view, const Members& members) {
  T message;
  members(message, MemberReader{view});
  return message;
}

constexpr auto kCounterMembers = [](auto& counters, const auto& visit) {
  visit("occlusion_rays", counters.occlusion_rays);
  visit("nearest_rays", counters.nearest_rays);
  visit("shadow_rays", counters.shadow_rays);
  visit("bounce_rays", counters.bounce_rays);
  visit("rejected_rays", counters.rejected_rays);
  visit("filter_calls", counters.filter_calls);
  visit("texture_reads", counters.texture_reads);
  visit("environment_reads", counters.environment_reads);
  visit("projected_texels", counters.projected_texels);
  visit("cube_texels", counters.cube_texels);
};

// A chunk's round keeps the sum, so that sums over chunks are exact.
constexpr auto kChunkRoundMembers = [](auto& round, const auto& visit) {
  visit("samples", round.samples);
  visit("rays", round.rays);
  visit("elements", round.elements);
  visit("cpu_s", round.cpu_s);
  visit("wall_s", round.wall_s);
  visit("error_sum_sq", round.error_sum_sq);
  visit("error_max", round.error_max);
  visit("converged", round.converged);
};

constexpr auto kPriceMembers = [](auto& price, const auto& visit) {
  visit("error", price.error);
  visit("samples", price.samples);
  visit("seconds", price.seconds);
  visit("extrapolated", price.extrapolated);
};

constexpr auto kEffectMembers = [](auto& effect, const auto& visit) {
  visit("effect", effect.name);
  visit("active", effect.active);
  visit("reason", effect.reason);
  visit("bound", effect.bound);
};

template <typename T, typename Members>
void write_list(JsonWriter& writer, const std::vector<T>& list, const Members& members) {
  writer.begin_array();
  for (const T& message : list) {
    writer.begin_object();
    write_members(writer, message, members);
    writer.end_object();
  }
  writer.end_array();
}
template <typename T, typename Members>
std::vector<T> read_list(const JsonView& view, const Members& members) {
  std::vector<T> list;
  for (const JsonValue& item : view.items())
    list.push_back(read_members<T>(view.view(item), members));
  return list;
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
  write_list(writer, prices, kPriceMembers);
}

std::string write_plan(const Plan& plan) {
  JsonWriter writer;
  writer.begin_object()
      .member("kind", kind_name(plan.kind))
      .member("engine_version", plan.engine_version)
      .member("isa", plan.isa)
      .key("effects");
  write_list(writer, plan.effects, kEffectMembers);
  writer.member("warnings", plan.warnings).key("repairs").begin_array();
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
  plan.effects = read_list<Effect>(view.at("effects"), kEffectMembers);
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
  plan.prices = read_list<Price>(view.at("prices"), kPriceMembers);
  plan.bias_bound = view.number("bias_bound");
  plan.predicted_s = view.number("predicted_s");
  plan.predicted_low_s = view.number("predicted_low_s");
  plan.predicted_high_s = view.number("predicted_high_s");
  plan.pilot_s = view.number("pilot_s");
  return plan;
}

std::string write_chunk_report(const ChunkReport& report) {
  JsonWriter writer;
  writer.begin_object().member("elements", report.elements).key("rounds");
  write_list(writer, report.rounds, kChunkRoundMembers);
  writer.key("counters").begin_object();
  write_members(writer, report.counters, kCounterMembers);
  writer.end_object()
      .member("cpu_s", report.cpu_s)
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
  report.rounds = read_list<Round>(view.at("rounds"), kChunkRoundMembers);
  report.counters = read_members<RayCounters>(view.at("counters"), kCounterMembers);
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
      .key("counters")
      .begin_object();
  write_members(writer, record.counters, kCounterMembers);
  writer.end_object().end_object();
  return writer.take();
}

}  // namespace lightkiln
