#include "server/worker/feed.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "proto/json.h"

namespace lightkiln {

namespace {

constexpr size_t kMaxDetailBytes = 1000;
constexpr size_t kMaxNameBytes = 128;
constexpr size_t kMaxArtifacts = 100'000;

[[noreturn]] void refuse(const std::string& what) {
  throw OvenFailure{{error_code_name(ErrorCode::internal), what, ""}, false};
}

// An oven has read a client's file: what it says is checked like anything else from outside.
std::string cleaned(std::string_view text) {
  std::string clean(text.substr(0, kMaxDetailBytes));
  for (char& c : clean)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return clean;
}

bool is_known_code(std::string_view code) {
  for (int i = 0; i <= static_cast<int>(ErrorCode::internal); ++i)
    if (code == error_code_name(static_cast<ErrorCode>(i))) return true;
  return false;
}

bool is_good_name(std::string_view name) {
  return !name.empty() && name.size() <= kMaxNameBytes && name[0] != '.' &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") ==
             std::string_view::npos;
}

[[noreturn]] void throw_failure(const Frame& frame) {
  PayloadReader reader(frame.payload);
  OvenFailure failure;
  failure.error.code = cleaned(reader.text());
  failure.error.detail = cleaned(reader.text());
  failure.error.pointer = cleaned(reader.text());
  if (!is_known_code(failure.error.code) ||
      failure.error.code == error_code_name(ErrorCode::internal)) {
    std::fprintf(stderr, "oven: %s: %s\n", failure.error.code.c_str(),
                 failure.error.detail.c_str());
    failure.error = {error_code_name(ErrorCode::internal),
                     "The bake failed by a mistake of Lightkiln's own; the worker's log has more.",
                     ""};
  }
  failure.crashed = failure.error.code == error_code_name(ErrorCode::out_of_memory);
  throw failure;
}

// Only the client has the bytes: whatever became of the stored ones, sending them again is the
// cure.
Descriptor open_input(Store& store, const std::string& digest) {
  try {
    uint64_t size = 0;
    return Descriptor(store.open_blob(digest, &size));
  } catch (const Error& error) {
    const bool damaged = error.code() == ErrorCode::internal;
    if (!damaged && error.code() != ErrorCode::not_found) throw;
    throw OvenFailure{{error_code_name(ErrorCode::invalid_input),
                       "The stored input " + digest + " is " + (damaged ? "damaged" : "gone") +
                           "; upload it again.",
                       ""},
                      false};
  }
}

// A number that is stored and added up: an oven's NaN must not get that far.
double measure(double value, const char* name) {
  if (!std::isfinite(value) || value < 0)
    refuse(std::string("The oven reported a ") + name + " that is not a finite number from 0 up.");
  return value;
}

double progress_of(PayloadReader& reader) {
  const double fraction = reader.real();
  if (!std::isfinite(fraction)) refuse("The oven reported a progress that is not a finite number.");
  return std::clamp(fraction, 0.0, 1.0);
}

// Passes progress on until a frame of type `expected` comes.
Frame await(OvenProcess& oven, FrameType expected, const OnProgress& on_progress) {
  for (;;) {
    Frame frame = *oven.channel().receive(-1);
    if (frame.type == expected) return frame;
    if (frame.type == FrameType::error) throw_failure(frame);
    if (frame.type != FrameType::progress) refuse("The oven answered out of turn.");
    PayloadReader reader(frame.payload);
    on_progress(progress_of(reader));
  }
}

}  // namespace

void feed_job(OvenProcess& oven, Store& store, const Claim& claim, const FeedOptions& options,
              const OnProgress& on_progress) {
  const ParsedSpec parsed = parse_spec(claim.spec_json);
  for (const std::string& digest : input_digests(parsed.spec)) {
    const Descriptor blob = open_input(store, digest);
    oven.channel().send(FrameType::input, PayloadWriter().text(digest).take(), blob.get());
  }
  oven.channel().send(FrameType::load, PayloadWriter()
                                           .text(claim.spec_json)
                                           .number(static_cast<uint64_t>(options.threads))
                                           .number(options.memory_bytes)
                                           .real(options.chunk_seconds)
                                           .take());
  await(oven, FrameType::loaded, on_progress);
}

PlanAnswer feed_plan(OvenProcess& oven, const OnProgress& on_progress) {
  oven.channel().send(FrameType::plan, {});
  const Frame frame = await(oven, FrameType::plan_result, on_progress);
  PayloadReader reader(frame.payload);
  PlanAnswer answer;
  answer.plan_json = reader.text();
  answer.chunks = reader.number();
  answer.predicted_s = measure(reader.real(), "predicted time");
  reader.end();
  if (answer.chunks < 1 || answer.chunks > 1'000'000) refuse("The oven planned no chunks.");
  return answer;
}

void feed_known_plan(OvenProcess& oven, const std::string& plan_json) {
  oven.channel().send(FrameType::use_plan, PayloadWriter().text(plan_json).take());
}

ChunkCommit feed_chunk(OvenProcess& oven, uint64_t index, const OnProgress& on_progress) {
  oven.channel().send(FrameType::chunk, PayloadWriter().number(index).take());
  const Frame frame = await(oven, FrameType::chunk_result, on_progress);
  PayloadReader reader(frame.payload);
  ChunkCommit commit;
  commit.bytes = reader.bytes();
  commit.report_json = reader.text();
  commit.elements = reader.number();
  commit.error_sum_sq = measure(reader.real(), "sum of squared errors");
  reader.end();
  return commit;
}

void feed_stored_chunk(OvenProcess& oven, const StoredChunk& chunk) {
  oven.channel().send(FrameType::stored_chunk,
                      PayloadWriter().bytes(chunk.bytes).text(chunk.report_json).take());
}

std::string feed_assembly(OvenProcess& oven, const std::function<void(NewArtifact)>& take,
                          const OnProgress& on_progress) {
  oven.channel().send(FrameType::assemble, {});
  std::set<std::string> names;
  for (;;) {
    Frame frame = *oven.channel().receive(-1);
    PayloadReader reader(frame.payload);
    if (frame.type == FrameType::error) throw_failure(frame);
    if (frame.type == FrameType::progress) {
      on_progress(progress_of(reader));
    } else if (frame.type == FrameType::artifact) {
      NewArtifact artifact;
      artifact.name = reader.text();
      artifact.role = cleaned(reader.text());
      artifact.media_type = cleaned(reader.text());
      artifact.bytes = reader.bytes();
      reader.end();
      if (!is_good_name(artifact.name) || !names.insert(artifact.name).second ||
          names.size() > kMaxArtifacts)
        refuse("The oven gave an artifact a name that is not allowed or not unique.");
      frame.payload.clear();
      frame.payload.shrink_to_fit();
      take(std::move(artifact));
    } else if (frame.type == FrameType::result) {
      std::string accuracy_json(reader.text());
      reader.end();
      return accuracy_json;
    } else {
      refuse("The oven answered out of turn.");
    }
  }
}

}  // namespace lightkiln
