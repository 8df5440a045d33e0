#include <algorithm>
#include <iostream>

#include "proto/order.h"
#include "server/cli/commands/commands.h"
#include "server/cli/commands/text.h"
#include "server/cli/commands/watch.h"

namespace lightkiln::cli {
namespace {

Order read_order_file(const std::string& path) {
  try {
    return read_order(path);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::not_found) usage_error(error.what());
    throw;
  }
}

void upload_missing(Session& session, const Order& order, const std::vector<std::string>& missing) {
  for (const std::string& digest : missing) {
    const auto blob = std::find_if(order.blobs.begin(), order.blobs.end(),
                                   [&](const OrderBlob& known) { return known.digest == digest; });
    if (blob == order.blobs.end())
      throw Error(ErrorCode::invalid_spec,
                  "The order names the blob " + digest +
                      ", which the server does not have and no file of the order gives.");
    if (!session.arguments().quiet)
      std::cerr << "Uploading " << printable(blob->file.filename().string()) << ", "
                << format_count(blob->bytes) << " bytes.\n";
    session.client().upload(digest, blob->file, blob->bytes);
  }
}

// A private daemon bakes its user's own files, so it does so on machines that cannot shut its ovens
// in (most containers, old kernels); that is no secret.
void warn_of_missing_sandbox(Session& session) {
  if (!session.is_private() || session.arguments().quiet) return;
  for (const WorkerMessage& worker : session.client().workers()) {
    if (worker.missing_sandbox_layers.empty()) continue;
    std::string layers;
    for (const std::string& layer : worker.missing_sandbox_layers)
      layers += (layers.empty() ? "" : ", ") + layer;
    std::cerr << "Warning: on this machine the sandbox around the baking process lacks "
              << printable(layers) << "; bake only files that you trust.\n";
    return;
  }
}

bool hopeless(const JobMessage& job) {
  if (!job.error) return false;
  for (const ErrorCode code : {ErrorCode::invalid_spec, ErrorCode::invalid_input,
                               ErrorCode::unsupported, ErrorCode::too_large})
    if (job.error->code == error_code_name(code)) return true;
  return false;
}

}  // namespace

std::string prepare_order(Session& session) {
  const Arguments& arguments = session.arguments();
  const Order order = read_order_file(arguments.target);
  const std::string request =
      write_job_request(order.spec_json, arguments.name, arguments.labels, arguments.priority);
  const ValidationMessage validation = session.client().validate(request);
  upload_missing(session, order, validation.missing_blobs);
  return request;
}

std::string submission_key(const Session& session, const std::string& request_json) {
  if (!session.is_private()) return new_idempotency_key();
  const std::string text = std::string(kEngineVersion) + "\n" + request_json;
  return "kiln-" + sha256_digest(text.data(), text.size()).substr(7, 48);
}

JobMessage revive(Session& session, const SubmitAnswer& answer) {
  const JobMessage& job = answer.job;
  if (!session.is_private() || !answer.replayed) return job;
  if (!job.terminal || job.state == "succeeded" || hopeless(job)) return job;
  return session.client().retry(job.id);
}

ExitCode bake(const Arguments& arguments) {
  Session session(arguments, ServerNeed::private_will_do);
  const std::string request = prepare_order(session);
  JobMessage job =
      revive(session, session.client().submit(request, submission_key(session, request), 1));
  job = watch(session, job);
  warn_of_missing_sandbox(session);
  std::vector<ArtifactMessage> artifacts;
  if (job.state == "succeeded") artifacts = fetch_artifacts(session, job, {});
  if (arguments.json)
    std::cout << write_job(job) << '\n';
  else if (job.state == "succeeded")
    print_result(job, artifacts);
  return conclude(job, arguments);
}

ExitCode submit(const Arguments& arguments) {
  Session session(arguments, ServerNeed::must_be_named);
  const std::string request = prepare_order(session);
  const JobMessage job = session.client().submit(request, submission_key(session, request), 0).job;
  std::cout << (arguments.json ? write_job(job) : printable(job.id)) << '\n';
  return kSucceeded;
}

}  // namespace lightkiln::cli
