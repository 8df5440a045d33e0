// Immutable bytes by their digest: uploaded once, while they are hashed.

#include <unordered_set>

#include "proto/messages.h"
#include "server/http/problems.h"
#include "server/http/ranges.h"
#include "server/http/routes.h"

namespace lightkiln {

namespace {

constexpr size_t kPieceBytes = 256 * 1024;

const std::string& need_digest(const RouteCall& call) {
  if (!is_digest(call.values[0]))
    throw HttpRefusal{400, "A blob is named sha256: and 64 lower-case hexadecimal digits."};
  return call.values[0];
}

// RFC 9530: where the client states the body's SHA-256 it must be the one in the path.
void check_content_digest(const HttpHead& head, const std::string& digest) {
  const std::string* stated = head.header("content-digest");
  if (!stated || stated->find("sha-256=") == std::string::npos) return;
  if (stated->find(repr_digest(digest)) == std::string::npos)
    throw Error(ErrorCode::invalid_input,
                "Content-Digest states another SHA-256 than the path names.");
}

HttpReply put_blob(RouteContext& context, RouteCall& call) {
  const std::string& digest = need_digest(call);
  IncomingRequest& request = call.request;
  check_content_digest(request.head, digest);
  auto upload = context.store.begin_upload();
  upload->append(request.body.data(), request.body.size());
  if (request.reader) {
    std::vector<char> piece(kPieceBytes);
    while (const size_t got = request.reader->read(piece.data(), piece.size()))
      upload->append(piece.data(), got);
  }
  HttpReply reply;
  reply.status = upload->commit(digest) ? 201 : 200;
  reply.set("ETag", '"' + digest + '"').set("Repr-Digest", repr_digest(digest));
  if (reply.status == 201) reply.set("Location", std::string(kApiPrefix) + "/blobs/" + digest);
  return reply;
}

HttpReply fetch_blob(RouteContext& context, RouteCall& call) {
  const std::string& digest = need_digest(call);
  FileBody file;
  file.descriptor = own_descriptor(context.store.open_blob(digest, &file.length));
  return file_reply(call.request.head, std::move(file), digest, "application/octet-stream")
      .set("Content-Disposition", "attachment")
      .set("Content-Security-Policy", "default-src 'none'; sandbox");
}

HttpReply missing_blobs(RouteContext& context, RouteCall& call) {
  const ParsedDigests parsed = parse_digests(call.request.body);
  if (!parsed.faults.empty()) return faults_reply(parsed.faults, call.request.head.request_id);
  std::vector<std::string> asked;
  std::unordered_set<std::string> seen;
  for (const std::string& digest : parsed.digests)
    if (seen.insert(digest).second) asked.push_back(digest);
  return json_reply(write_missing(context.store.missing_blobs(asked)));
}

}  // namespace

std::vector<Route> blob_routes() {
  return {
      {"PUT", "/v1/blobs/{digest}", Scope::submit, BodyRule::streamed, {}, put_blob},
      {"GET", "/v1/blobs/{digest}", Scope::read, BodyRule::none, {}, fetch_blob},
      {"HEAD", "/v1/blobs/{digest}", Scope::read, BodyRule::none, {}, fetch_blob},
      {"POST", "/v1/blobs:missing", Scope::submit, BodyRule::buffered, {}, missing_blobs},
  };
}

}  // namespace lightkiln
