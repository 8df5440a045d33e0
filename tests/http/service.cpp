#include "tests/http/service.h"

#include <atomic>
#include <stdexcept>

#include "tests/http/raw_client.h"
#include "tests/store/whole.h"

namespace lightkiln::test {

std::vector<std::byte> to_bytes(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

std::string artifact_bytes() {
  std::string bytes;
  for (size_t i = 0; i < kArtifactBytes; ++i) bytes += static_cast<char>(i % 252);
  return bytes;
}

FenceLimits Service::roomy() {
  FenceLimits limits;
  limits.connections = limits.connections_per_address = 3000;
  return limits;
}

namespace {

StoreOptions store_in(const TemporaryFolder& folder, StoreOptions options) {
  options.directory = folder.path() / "store";
  return options;
}

}  // namespace

Service::Service(FenceLimits limits, ApiOptions options, StoreOptions kept)
    : log(LogLevel::error),
      store(open_sqlite_store(store_in(folder, std::move(kept)))),
      api(*store, log, std::move(options)),
      fence(limits, api.application()),
      port(fence.listen("127.0.0.1", 0)) {}

Service::~Service() {
  api.stop_waiting();
  fence.stop(1000);
}

std::string Service::upload(const std::string& bytes) {
  return store->put_blob(to_bytes(bytes));
}

std::string Service::order(const std::string& digest, const std::string& name) {
  return R"({"spec":{"kind":"ambient_occlusion","inputs":{"scene":")" + digest + R"("}},"name":")" +
         name + R"("})";
}

std::string Service::submit() {
  static std::atomic<int> count{0};
  const std::string digest = upload("scene " + std::to_string(count++));
  const RawReply reply = post(port, "/v1/jobs", order(digest));
  if (reply.status != 202) throw std::runtime_error("not accepted: " + reply.body);
  return read_job(reply.body).id;
}

Claim Service::take() {
  auto claim = store->claim("test", "");
  if (!claim) throw std::runtime_error("no task to claim");
  return *claim;
}

void Service::work() {
  while (const auto claim = store->claim("test", "")) {
    if (claim->type == TaskType::plan) {
      Plan plan;
      plan.elements = 20;
      plan.chunks = {{0, 10}, {10, 10}};
      plan.predicted_s = 3;
      store->commit_plan(*claim, write_plan(plan), 2, plan.predicted_s);
    } else if (claim->type == TaskType::chunk) {
      ChunkReport report;
      report.elements = 10;
      Round round;
      round.samples = 64;
      round.rays = 640;
      round.elements = 10;
      round.cpu_s = round.wall_s = 0.5;
      round.error_sum_sq = 0.1;
      round.error_max = 0.2;
      report.rounds = {round};
      store->commit_chunk(*claim, {to_bytes("chunk"), write_chunk_report(report)});
    } else {
      commit_result(*store, *claim,
                    {{"ao.exr", "image", "image/x-exr", to_bytes(artifact_bytes())},
                     {"view.png", "preview", "image/png", to_bytes("not really a png")}},
                    write_accuracy({}));
    }
  }
}

}  // namespace lightkiln::test
