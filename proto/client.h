#pragma once

// A client of the daemon, the same for local and remote use. Every call tries again with growing
// pauses when the server cannot be reached or says 429, 502, 503 or 504, so every call is one that
// may be repeated: submissions carry an Idempotency-Key, uploads and downloads are named by digest.

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages.h"
#include "proto/problem.h"

namespace lightkiln {

// What a server refused, with its whole problem document.
class ServerProblem : public Error {
 public:
  explicit ServerProblem(const Problem& problem);
  const Problem& problem() const { return problem_; }

 private:
  Problem problem_;
};

// Bytes that came are not those that were promised.
class DigestMismatch : public Error {
 public:
  explicit DigestMismatch(const std::string& sentence)
      : Error(ErrorCode::invalid_input, sentence) {}
};

struct ClientOptions {
  std::string server;           // "http://127.0.0.1:7420"
  std::string token;            // "" = none
  int retries = 5;              // tries after the first
  double first_pause_s = 0.25;  // doubles from try to try up to 8 s, plus up to a quarter at random
  double read_timeout_s = 30;
  // Asked often; true ends any call with Error{cancelled}.
  std::function<bool()> interrupted;
};

struct JobQuery {
  std::string state, kind, text, label;  // "" = any; label is "key:value"
  int limit = 50;
  std::string after;
};

struct SubmitAnswer {
  JobMessage job;
  bool replayed = false;  // the key was used before: the job is that of the earlier submission
};

class Client {
 public:
  // Throws Error{invalid_input} for a server that is no URL.
  explicit Client(ClientOptions options);

  const std::string& server() const { return options_.server; }

  VersionMessage version();
  ValidationMessage validate(const std::string& request_json);
  std::vector<WorkerMessage> workers();
  std::vector<std::string> missing_blobs(const std::vector<std::string>& digests);
  // Streams the file, which hashed to `digest` and has `bytes` bytes. False when it was known.
  bool upload(const std::string& digest, const std::filesystem::path& file, uint64_t bytes);

  // `request_json` from write_job_request(); waits up to `wait_s` seconds for the end.
  SubmitAnswer submit(const std::string& request_json, const std::string& idempotency_key,
                      int wait_s);
  SubmitAnswer submit_plan(const std::string& request_json, const std::string& idempotency_key,
                           int wait_s);
  // Waits up to `wait_s` seconds for the end of the job, and gives what it is then.
  JobMessage job(const std::string& id, int wait_s = 0);
  JobPage list(const JobQuery& query);
  JobMessage cancel(const std::string& id);
  JobMessage retry(const std::string& id);
  std::vector<ArtifactMessage> artifacts(const std::string& id);
  std::string plan(const std::string& id);      // plan.json
  std::string accuracy(const std::string& id);  // accuracy.json

  // Writes `target` through "<target>.part", going on where a part stands; nothing stays at
  // `target` unless every byte was checked. Throws DigestMismatch.
  void download(const std::string& id, const ArtifactMessage& artifact,
                const std::filesystem::path& target);

 private:
  struct Call;
  struct Answer;
  Answer call(const Call& call);
  Answer call_once(const Call& call);
  bool pause(int tried, double at_least_s);
  SubmitAnswer post_job(const std::string& path, const std::string& request_json,
                        const std::string& idempotency_key, int wait_s);

  ClientOptions options_;
};

// A random Idempotency-Key.
std::string new_idempotency_key();

}  // namespace lightkiln
