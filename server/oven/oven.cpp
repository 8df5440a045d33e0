#include "server/oven/oven.h"

#include <new>
#include <optional>
#include <system_error>

#include <sys/mman.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "proto/json.h"
#include "server/oven/preview.h"

namespace lightkiln {

namespace {

constexpr double kProgressEvery_s = 0.05;

// A blob mapped read-only for as long as the job lasts.
class Mapping {
 public:
  explicit Mapping(const Descriptor& blob) {
    const off_t end = lseek(blob.get(), 0, SEEK_END);
    if (end < 0) throw Error(ErrorCode::internal, "An input's size cannot be read.");
    size_ = static_cast<size_t>(end);
    if (size_ == 0) return;
    void* memory = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, blob.get(), 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    data_ = memory;
  }
  ~Mapping() {
    if (data_) munmap(data_, size_);
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  std::span<const std::byte> bytes() const { return {static_cast<const std::byte*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  size_t size_ = 0;
};

std::vector<std::byte> as_bytes(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

class Oven {
 public:
  explicit Oven(Channel& channel) : channel_(channel) {}

  void answer(Frame& frame) {
    switch (frame.type) {
      case FrameType::input:
        return add_input(frame);
      case FrameType::load:
        return load(frame);
      case FrameType::plan:
        return make_plan();
      case FrameType::use_plan:
        plan_ = read_plan(PayloadReader(frame.payload).text());
        return;
      case FrameType::chunk:
        return bake_chunk(PayloadReader(frame.payload).number());
      case FrameType::stored_chunk:
        return add_chunk(frame);
      case FrameType::assemble:
        return assemble();
      default:
        throw Error(ErrorCode::internal, "The worker sent a frame that only ovens send.");
    }
  }

 private:
  void add_input(const Frame& frame) {
    const std::string digest(PayloadReader(frame.payload).text());
    auto mapping = std::make_unique<Mapping>(frame.descriptor);
    inputs_.blobs[digest] = mapping->bytes();
    mappings_.push_back(std::move(mapping));
  }

  void load(const Frame& frame) {
    PayloadReader reader(frame.payload);
    ParsedSpec parsed = parse_spec(reader.text());
    if (!parsed.faults.empty())
      throw Error(ErrorCode::invalid_spec, parsed.faults.front().message,
                  parsed.faults.front().pointer);
    spec_ = std::move(parsed.spec);
    Grants grants;
    grants.threads = static_cast<int>(reader.number());
    grants.max_memory_bytes = reader.number();
    grants.chunk_seconds = reader.real();
    reader.end();
    threads_ = grants.threads;
    bake_.emplace(spec_, inputs_, grants);
    channel_.send(FrameType::loaded, {});
  }

  // Work in hand reports through this; whatever the worker sends meanwhile means "stop".
  Progress make_progress() {
    return Progress([this, last_s = wall_seconds()](double fraction) mutable {
      if (channel_.readable()) return false;
      const double now_s = wall_seconds();
      if (now_s - last_s < kProgressEvery_s) return true;
      last_s = now_s;
      channel_.send(FrameType::progress, PayloadWriter().real(fraction).take());
      return true;
    });
  }

  Bake& bake() {
    if (!bake_) throw Error(ErrorCode::internal, "The worker asked before it loaded a job.");
    return *bake_;
  }
  const Plan& plan() const {
    if (!plan_) throw Error(ErrorCode::internal, "The worker asked before it named the plan.");
    return *plan_;
  }

  void make_plan() {
    Progress progress = make_progress();
    const Plan fresh = bake().plan(progress);
    const std::string json = write_plan(fresh);
    // Read back, so that this oven works from exactly what a later one will be told.
    plan_ = read_plan(json);
    channel_.send(
        FrameType::plan_result,
        PayloadWriter().text(json).number(fresh.chunks.size()).real(fresh.predicted_s).take());
  }

  void bake_chunk(uint64_t index) {
    if (index >= plan().chunks.size())
      throw Error(ErrorCode::internal, "The worker asked for a chunk that the plan does not have.");
    Progress progress = make_progress();
    const ChunkResult result = bake().chunk(plan(), plan().chunks[index], progress);
    const ChunkReport& report = result.report;
    channel_.send(FrameType::chunk_result,
                  PayloadWriter()
                      .bytes(result.bytes)
                      .text(write_chunk_report(report))
                      .number(report.elements)
                      .real(report.rounds.empty() ? 0.0 : report.rounds.back().error_sum_sq)
                      .take());
  }

  void add_chunk(const Frame& frame) {
    PayloadReader reader(frame.payload);
    ChunkResult chunk;
    chunk.bytes = reader.bytes();
    chunk.report = read_chunk_report(reader.text());
    reader.end();
    chunks_.push_back(std::move(chunk));
  }

  void assemble() {
    Progress progress = make_progress();
    Assembly assembly = bake().assemble(plan(), chunks_, progress);
    std::vector<Artifact> previews = make_previews(assembly.pictures, threads_, progress);
    const std::string accuracy = write_accuracy(assembly.accuracy);
    const auto add = [&](const std::string& name, const char* role, const std::string& json) {
      assembly.artifacts.push_back({name, role, "application/json", as_bytes(json)});
    };
    for (Artifact& file : write_exports(assembly)) assembly.artifacts.push_back(std::move(file));
    add(document_name(spec_.kind()), "document", write_document(assembly, spec_, plan()));
    add("plan.json", "plan", write_plan(plan()));
    add("accuracy.json", "accuracy", accuracy);
    for (Artifact& preview : previews) assembly.artifacts.push_back(std::move(preview));
    for (const Artifact& artifact : assembly.artifacts)
      channel_.send(FrameType::artifact, PayloadWriter()
                                             .text(artifact.name)
                                             .text(artifact.role)
                                             .text(artifact.media_type)
                                             .bytes(artifact.bytes)
                                             .take());
    channel_.send(FrameType::result, PayloadWriter().text(accuracy).take());
  }

  Channel& channel_;
  std::vector<std::unique_ptr<Mapping>> mappings_;
  Inputs inputs_;
  Spec spec_;
  int threads_ = 1;
  std::optional<Bake> bake_;
  std::optional<Plan> plan_;
  std::vector<ChunkResult> chunks_;
};

void send_error(Channel& channel, const char* code, const std::string& sentence,
                const std::string& pointer) {
  channel.send(FrameType::error, PayloadWriter()
                                     .text(code)
                                     .text(std::string_view(sentence).substr(0, 4096))
                                     .text(std::string_view(pointer).substr(0, 4096))
                                     .take());
}

}  // namespace

int serve_oven(Channel& channel, const std::vector<std::string>& missing_layers) {
  PayloadWriter hello;
  hello.number(missing_layers.size());
  for (const std::string& layer : missing_layers) hello.text(layer);
  channel.send(FrameType::hello, hello.take());

  Oven oven(channel);
  for (;;) {
    std::optional<Frame> frame;
    try {
      frame = channel.receive(-1);
    } catch (const Error&) {
      return 0;  // the worker hung up: the job is over
    }
    try {
      oven.answer(*frame);
    } catch (const Error& error) {
      send_error(channel, error_code_name(error.code()), error.what(), error.where());
      return 1;
    } catch (const std::bad_alloc&) {
      send_error(channel, error_code_name(ErrorCode::out_of_memory),
                 "The job needs more memory than an oven may take.", "");
      return 1;
    } catch (const std::system_error& error) {
      // The C++ library reports a thread that found no room for its stack this way.
      const bool no_room = error.code() == std::errc::resource_unavailable_try_again ||
                           error.code() == std::errc::not_enough_memory;
      send_error(channel, error_code_name(no_room ? ErrorCode::out_of_memory : ErrorCode::internal),
                 error.what(), "");
      return 1;
    } catch (const std::exception& error) {
      send_error(channel, error_code_name(ErrorCode::internal), error.what(), "");
      return 1;
    }
  }
}

}  // namespace lightkiln
