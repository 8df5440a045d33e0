// What a job made.

#include "proto/messages.h"
#include "server/http/job_view.h"
#include "server/http/ranges.h"
#include "server/http/routes.h"

namespace lightkiln {

namespace {

HttpReply list_artifacts(RouteContext& context, RouteCall& call) {
  const JobRecord job = need_job(context.store, call.values[0]);
  std::vector<ArtifactMessage> messages;
  for (const ArtifactRecord& artifact : context.store.artifacts(job.id))
    messages.push_back(artifact_message(artifact));
  return tagged_reply(call.request.head, write_artifact_list(job.id, messages), job_etag(job));
}

// RFC 6266: a plain name quoted; anything else also percent-encoded.
std::string disposition(const ArtifactRecord& artifact) {
  const char* how = artifact.media_type == "image/png" ? "inline" : "attachment";
  std::string plain;
  for (const char c : artifact.name)
    plain += c == '"' || c == '\\' || static_cast<unsigned char>(c) >= 0x7f ? '_' : c;
  return std::string(how) + "; filename=\"" + plain + '"';
}

HttpReply fetch_artifact(RouteContext& context, RouteCall& call) {
  const JobRecord job = need_job(context.store, call.values[0]);
  for (const ArtifactRecord& artifact : context.store.artifacts(job.id)) {
    if (artifact.name != call.values[1]) continue;
    FileBody file;
    file.descriptor = own_descriptor(context.store.open_blob(artifact.digest, &file.length));
    return file_reply(call.request.head, std::move(file), artifact.digest, artifact.media_type)
        .set("Content-Disposition", disposition(artifact))
        .set("Content-Security-Policy", "default-src 'none'; sandbox");
  }
  throw Error(ErrorCode::not_found, "The job has no artifact of this name.");
}

}  // namespace

std::vector<Route> artifact_routes() {
  const BodyRule none = BodyRule::none;
  return {
      {"GET", "/v1/jobs/{id}/artifacts", Scope::read, none, {}, list_artifacts},
      {"GET", "/v1/jobs/{id}/artifacts/{name}", Scope::read, none, {}, fetch_artifact},
      {"HEAD", "/v1/jobs/{id}/artifacts/{name}", Scope::read, none, {}, fetch_artifact},
  };
}

}  // namespace lightkiln
