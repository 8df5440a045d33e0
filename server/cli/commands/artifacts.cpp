#include <algorithm>
#include <filesystem>
#include <iostream>

#include "proto/digest.h"
#include "server/cli/commands/commands.h"
#include "server/cli/commands/text.h"

namespace lightkiln::cli {
namespace {

namespace fs = std::filesystem;

// A name from a server becomes a file of ours only when it is nothing but a name.
void refuse_path(const std::string& name) {
  const bool plain = !name.empty() && name.size() <= 200 && name[0] != '.' &&
                     name.find_first_of(std::string("/\\\0", 3)) == std::string::npos;
  if (!plain)
    throw Error(ErrorCode::unavailable,
                "The server names an artifact \"" + name + "\", which is no file name.");
}

bool stands_already(const fs::path& path, const ArtifactMessage& artifact) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || fs::file_size(path, error) != artifact.bytes)
    return false;
  return sha256_file(path).digest == artifact.digest;
}

void print_accuracy(const JobMessage& job) {
  const Plan plan = job.plan_json.empty() ? Plan{} : read_plan(job.plan_json);
  if (!job.plan_json.empty() && plan.elements == 0) {
    std::cout << printable(format_units(0, plan.element_unit)) << ": there was nothing to bake";
    return;
  }
  std::cout << "error " << (job.quality.error ? format_error(*job.quality.error) : "not known")
            << " of " << format_error(job.quality.target) << " ordered";
  if (!job.quality.unit.empty()) std::cout << " (" << printable(job.quality.unit) << ")";
}

}  // namespace

std::vector<ArtifactMessage> fetch_artifacts(Session& session, const JobMessage& job,
                                             const std::vector<std::string>& only) {
  std::vector<ArtifactMessage> chosen;
  for (const ArtifactMessage& artifact : session.client().artifacts(job.id)) {
    const bool wanted =
        only.empty() || std::find(only.begin(), only.end(), artifact.name) != only.end();
    if (wanted) chosen.push_back(artifact);
  }
  for (const std::string& name : only) {
    const bool found = std::any_of(chosen.begin(), chosen.end(),
                                   [&](const ArtifactMessage& a) { return a.name == name; });
    if (!found)
      throw Error(ErrorCode::not_found, "The job " + job.id + " has no artifact \"" + name + "\".");
  }
  const fs::path folder = session.arguments().output;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) usage_error("The folder " + folder.string() + " cannot be made: " + error.message());
  for (const ArtifactMessage& artifact : chosen) {
    refuse_path(artifact.name);
    const fs::path target = folder / artifact.name;
    if (!stands_already(target, artifact)) session.client().download(job.id, artifact, target);
  }
  return chosen;
}

void print_result(const JobMessage& job, const std::vector<ArtifactMessage>& artifacts) {
  Table table{{"artifact", "bytes", "digest"}, {false, true, false}, {}};
  for (const ArtifactMessage& artifact : artifacts)
    table.rows.push_back({printable(artifact.name), format_count(artifact.bytes),
                          printable(artifact.digest.substr(0, 19))});
  print_table(std::cout, table);
  print_accuracy(job);
  if (job.started_ms > 0 && job.finished_ms >= job.started_ms)
    std::cout << "; time "
              << format_seconds(static_cast<double>(job.finished_ms - job.started_ms) / 1000)
              << ", predicted " << format_seconds(job.predicted_s) << " of baking";
  if (job.from_cache) std::cout << "; answered from the store";
  std::cout << '\n';
}

}  // namespace lightkiln::cli
