#include <iostream>

#include "server/cli/commands/commands.h"
#include "server/cli/commands/progress.h"
#include "server/cli/commands/text.h"
#include "server/cli/commands/watch.h"

namespace lightkiln::cli {
namespace {

void print_job(const JobMessage& job) {
  const auto line = [](const char* name, const std::string& value) {
    if (!value.empty())
      std::cout << name << std::string(12 - std::string(name).size(), ' ') << printable(value)
                << '\n';
  };
  line("id", job.id);
  line("name", job.name);
  line("kind", job.plan_only ? job.kind + ", plan only" : job.kind);
  line("state", progress_sentence(job));
  line("reason", job.reason);
  for (const auto& [key, value] : job.labels) line("label", key + "=" + value);
  line("priority", std::to_string(job.priority));
  if (job.predicted_s > 0) line("predicted", format_seconds(job.predicted_s));
  line("created", format_time(job.created_ms));
  if (job.started_ms > 0) line("started", format_time(job.started_ms));
  if (job.finished_ms > 0) line("finished", format_time(job.finished_ms));
  if (job.from_cache) line("cache", "answered from an earlier job's artifacts");
  if (job.attempts > 0) line("attempts", std::to_string(job.attempts));
  if (job.error) {
    line("error", job.error->code + ": " + job.error->detail);
    line("at", job.error->pointer);
  }
  for (const ArtifactMessage& artifact : job.artifacts)
    line("artifact", artifact.name + ", " + format_count(artifact.bytes) + " bytes");
  line("spec", job.spec_json);
  line("digest", job.spec_digest);
}

// The server may end a page before --limit.
JobPage list_pages(Session& session) {
  const Arguments& arguments = session.arguments();
  JobQuery query{arguments.state, arguments.kind,  arguments.text,
                 arguments.label, arguments.limit, ""};
  JobPage all;
  do {
    JobPage page = session.client().list(query);
    for (JobMessage& job : page.items) all.items.push_back(std::move(job));
    all.next = page.items.empty() ? "" : page.next;
    query.limit = arguments.limit - static_cast<int>(all.items.size());
    query.after = all.next;
  } while (query.limit > 0 && !all.next.empty());
  return all;
}

}  // namespace

ExitCode wait(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const JobMessage job = watch(session, session.client().job(arguments.target));
  if (arguments.json) std::cout << write_job(job) << '\n';
  return conclude(job, arguments);
}

ExitCode fetch(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const JobMessage job = session.client().job(arguments.target);
  if (job.state != "succeeded") {
    std::cerr << "kiln: The job " << printable(job.id) << " is " << printable(job.state)
              << "; artifacts appear when it has succeeded.\n";
    return job.state == "cancelled" ? kCancelled : kFailed;
  }
  const std::vector<ArtifactMessage> artifacts = fetch_artifacts(session, job, arguments.artifacts);
  if (arguments.json)
    std::cout << write_artifact_list(job.id, artifacts) << '\n';
  else
    print_result(job, artifacts);
  return kSucceeded;
}

ExitCode ls(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const JobPage page = list_pages(session);
  if (arguments.json) {
    std::cout << write_job_page(page) << '\n';
    return kSucceeded;
  }
  Table table{{"id", "kind", "state", "created", "name"}, {}, {}};
  for (const JobMessage& job : page.items)
    table.rows.push_back({printable(job.id), printable(job.kind), progress_sentence(job),
                          format_time(job.created_ms), printable(job.name)});
  print_table(std::cout, table);
  if (!page.next.empty()) std::cerr << "There are more; --limit shows up to 500.\n";
  return kSucceeded;
}

ExitCode show(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const JobMessage job = session.client().job(arguments.target);
  if (arguments.json)
    std::cout << write_job(job) << '\n';
  else
    print_job(job);
  return kSucceeded;
}

ExitCode cancel(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const JobMessage job = session.client().cancel(arguments.target);
  if (arguments.json)
    std::cout << write_job(job) << '\n';
  else
    std::cout << printable(job.id) << ' ' << printable(job.state) << '\n';
  return kSucceeded;
}

}  // namespace lightkiln::cli
