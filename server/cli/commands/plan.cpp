#include <iostream>

#include "server/cli/commands/commands.h"
#include "server/cli/commands/text.h"
#include "server/cli/commands/watch.h"

namespace lightkiln::cli {
namespace {

void print_effects(const Plan& plan) {
  Table table{{"effect", "", "at most", "reason"}, {false, false, true, false}, {}};
  for (const Effect& effect : plan.effects)
    table.rows.push_back({printable(effect.name), effect.active ? "on" : "off",
                          effect.bound > 0 ? format_error(effect.bound) : "-",
                          printable(effect.reason)});
  print_table(std::cout, table);
}

void print_prices(const Plan& plan) {
  Table table{{"error", "samples", "seconds", ""}, {true, true, true, false}, {}};
  for (const Price& price : plan.prices)
    table.rows.push_back({format_error(price.error), format_count(price.samples),
                          format_seconds(price.seconds),
                          price.extrapolated ? "extrapolated" : "by the pilot"});
  print_table(std::cout, table);
}

void print_plan(const Plan& plan) {
  std::cout << kind_name(plan.kind) << ": "
            << printable(format_units(plan.elements, plan.element_unit)) << " in "
            << format_units(plan.chunks.size(), "chunk") << ", at most "
            << format_count(plan.max_samples) << " samples each, "
            << format_seconds(plan.predicted_s) << " predicted ("
            << format_seconds(plan.predicted_low_s) << " to "
            << format_seconds(plan.predicted_high_s) << ")\n\n";
  print_effects(plan);
  std::cout << '\n';
  print_prices(plan);
  for (const auto& [what, count] : plan.repairs)
    std::cout << "\nrepaired or ignored: " << printable(what) << ", " << format_count(count);
  if (!plan.repairs.empty()) std::cout << '\n';
  for (const std::string& warning : plan.warnings)
    std::cout << "\nwarning: " << printable(warning) << '\n';
}

}  // namespace

ExitCode plan(const Arguments& arguments) {
  Session session(arguments, ServerNeed::private_will_do);
  const std::string request = prepare_order(session);
  JobMessage job = revive(session, session.client().submit_plan(
                                       request, submission_key(session, "plan " + request), 1));
  job = watch(session, job);
  if (job.state != "succeeded") return conclude(job, arguments);
  const std::string json = session.client().plan(job.id);
  if (arguments.json)
    std::cout << json << '\n';
  else
    print_plan(read_plan(json));
  return kSucceeded;
}

}  // namespace lightkiln::cli
