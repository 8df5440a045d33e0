#pragma once

// What crosses the wire between a client and the daemon, as plain structs with JSON both ways.
// proto/openapi.json describes the same messages for everybody else; a test holds the two together.
//
// write_*() gives compact JSON. read_*() is for a client reading a server: it checks types, needs
// every member that it names, ignores unknown ones (a newer server may say more), and throws
// Error{unavailable} when the text is not such a message. parse_*() is for the daemon reading a
// client: strict, and it reports every fault at once.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/json.h"

namespace lightkiln {

inline constexpr const char* kApiPrefix = "/v1";
inline constexpr int kMaxWaitSeconds = 60;           // of `Prefer: wait=N`
inline constexpr int kMaxPageSize = 500;             // of `limit`
inline constexpr size_t kMaxRequestBytes = 1 << 20;  // of a JSON body
inline constexpr size_t kMaxIdempotencyKeyBytes = 64;
inline constexpr size_t kMaxDigestsPerRequest = 10000;  // of blobs:missing

// --- requests --------------------------------------------------------------------------------

// The body of POST /v1/jobs, /v1/jobs:validate and /v1/plans.
struct JobRequest {
  Spec spec;
  std::string canonical;    // canonical_spec(spec)
  std::string spec_digest;  // spec_digest(canonical)
  std::string name;         // <= 200 bytes, no control characters; "" = none
  std::map<std::string, std::string>
      labels;        // <= 32; key [A-Za-z0-9._/-]{1,63}, value <= 200 bytes
  int priority = 0;  // -100..100, larger is sooner
};
struct ParsedJobRequest {
  JobRequest request;  // usable only without faults
  std::vector<SpecFault> faults;
};
ParsedJobRequest parse_job_request(std::string_view json);
// `spec_json` is any spec text; it is checked to be JSON and travels as it is.
std::string write_job_request(const std::string& spec_json, const std::string& name,
                              const std::map<std::string, std::string>& labels, int priority);

// The body of POST /v1/blobs:missing.
struct ParsedDigests {
  std::vector<std::string> digests;  // in the order given
  std::vector<SpecFault> faults;
};
ParsedDigests parse_digests(std::string_view json);
std::string write_digests(const std::vector<std::string>& digests);

// --- answers ---------------------------------------------------------------------------------

struct JobProgress {
  uint64_t done = 0;   // finished chunks
  uint64_t total = 0;  // 0 until planned
  std::string unit = "chunk";
  double fraction = 0;          // of the whole job, 0..1, the chunk in hand included
  std::optional<double> eta_s;  // until the job ends; none = not known
};
struct JobQuality {
  std::optional<double> error;  // rms 95 % half-width over what is finished; none = not known yet
  double target = 0;
  std::string unit;
};
struct JobErrorMessage {
  std::string code;     // a problem code, or "oven_crashed"
  std::string detail;   // one sentence
  std::string pointer;  // into the input, or ""
};
struct ArtifactMessage {
  std::string name;        // file name, unique in the job
  std::string role;        // "glb", "image", "table", "document"
  std::string media_type;  // "image/x-exr"
  uint64_t bytes = 0;
  std::string digest;  // "sha256:..."
};
struct JobMessage {
  std::string id;
  std::string name;
  std::string kind;
  bool plan_only = false;
  std::string state;      // queued | running | succeeded | failed | cancelled
  bool terminal = false;  // the state will not change by itself
  std::string stage;      // plan | bake | assemble | done
  std::string reason;     // why it is not running or not done
  std::string spec_json;  // canonical; written as an object when not empty; a page has none
  std::string spec_digest;
  std::map<std::string, std::string> labels;
  int priority = 0;
  JobProgress progress;
  JobQuality quality;
  double predicted_s = 0;  // wall seconds of baking by the plan; 0 until planned
  bool from_cache = false;
  int attempts = 0;
  std::optional<JobErrorMessage> error;
  int64_t created_ms = 0, started_ms = 0, finished_ms = 0;  // Unix time; 0 = not yet (null)
  std::vector<ArtifactMessage> artifacts;                   // when succeeded
  std::string plan_json;                                    // written as `plan` when not empty
};
// Adds `links` and each artifact's `href` from the id.
std::string write_job(const JobMessage& job);
JobMessage read_job(std::string_view json);

struct JobPage {
  std::vector<JobMessage> items;  // newest first
  std::string next;               // the `after` of the next page; "" = the last (null)
};
std::string write_job_page(const JobPage& page);
JobPage read_job_page(std::string_view json);

struct ValidationMessage {
  std::string spec_json;  // canonical
  std::string spec_digest;
  std::vector<std::string> missing_blobs;
};
std::string write_validation(const ValidationMessage& message);
ValidationMessage read_validation(std::string_view json);

// {"items":[{name,role,media_type,bytes,digest,href}]}
std::string write_artifact_list(const std::string& job_id,
                                const std::vector<ArtifactMessage>& artifacts);
std::vector<ArtifactMessage> read_artifact_list(std::string_view json);

struct EventMessage {
  uint64_t sequence = 0;
  std::string job_id;
  std::string type;
  int64_t time_ms = 0;
  std::string data_json;  // an object
};
// {"items":[{sequence,job_id,type,time,data}],"next_after":N}; next_after is the last sequence of
// the page, or `after` again when the page is empty.
std::string write_event_page(const std::vector<EventMessage>& events, uint64_t after);
struct EventPage {
  std::vector<EventMessage> items;
  uint64_t next_after = 0;
};
EventPage read_event_page(std::string_view json);

// {"target_error","unit","elements","rounds":[…],"time_to_error":[…]} of what is merged so far.
std::string write_convergence(const AccuracyRecord& record);

// {"missing":[…]}
std::string write_missing(const std::vector<std::string>& digests);
std::vector<std::string> read_missing(std::string_view json);

// A worker that bakes for this server.
struct WorkerMessage {
  std::string name;
  std::vector<std::string> missing_sandbox_layers;  // what its ovens' sandbox lacks on its machine
};
// {"items":[…]}
std::string write_workers(const std::vector<WorkerMessage>& workers);
std::vector<WorkerMessage> read_workers(std::string_view json);

struct VersionMessage {
  std::string name = "lightkiln";
  std::string version = LIGHTKILN_VERSION;
  std::string engine_version = kEngineVersion;
  std::string api = "v1";
};
std::string write_version(const VersionMessage& message);
VersionMessage read_version(std::string_view json);

// {"items":[{kind,title,parameters:[{pointer,type,default,minimum,…}]}]} from the field tables.
std::string write_kinds();

// --- small things both sides need -------------------------------------------------------------

// RFC 3339 in UTC with milliseconds: "2026-01-31T12:00:00.000Z".
std::string format_time(int64_t unix_ms);
// Throws Error{invalid_input} when the text is no such time.
int64_t parse_time(std::string_view text);
// Percent-encodes all but the unreserved characters of RFC 3986.
std::string percent_encode(std::string_view text);
std::string job_href(const std::string& id);
std::string artifact_href(const std::string& id, const std::string& name);
// RFC 9530: "sha-256=:<base64>:" from "sha256:<hex>".
std::string repr_digest(const std::string& digest);

}  // namespace lightkiln
