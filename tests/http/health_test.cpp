// A service that is not well, and the words it has for that.

#include <cstdint>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "proto/problem.h"
#include "server/http/problems.h"
#include "tests/http/raw_client.h"
#include "tests/http/service.h"

namespace lightkiln::test {
namespace {

TEST(Problems, EveryProblemOfTheHttpLayerCanBeRaised) {
  std::set<std::string> raised = {"malformed_json",           // by problem_from_faults
                                  kStorageFull, kQueueFull};  // by the store
  for (int i = 0; i <= static_cast<int>(ErrorCode::internal); ++i)
    raised.insert(error_code_name(static_cast<ErrorCode>(i)));
  for (int status = 400; status < 600; ++status) raised.insert(http_problem_code(status));
  for (const ProblemKind& kind : problem_kinds())
    EXPECT_TRUE(raised.contains(kind.code)) << kind.code;
}

TEST(Health, AServiceWhoseDiskIsFullIsNotReadyAndSaysSo) {
  StoreOptions full;
  full.min_free_bytes = UINT64_MAX;
  Service service(Service::roomy(), {}, full);
  for (const char* target : {"/readyz", "/readyz?verbose"}) {
    const RawReply reply = get(service.port, target);
    EXPECT_EQ(reply.status, 503);
    EXPECT_NE(reply.header("retry-after"), "");
    EXPECT_NE(read_problem(reply.body).detail.find("disk"), std::string::npos) << reply.body;
  }
  EXPECT_EQ(get(service.port, "/livez").status, 200);
  EXPECT_NE(get(service.port, "/metrics").body.find("lightkiln_store_writable 0\n"),
            std::string::npos);
}

TEST(Health, AFullDiskAndAFullQueueAreToldApart) {
  const auto expect_refusal = [](const RawReply& reply, int status, const char* code,
                                 const char* retry_after_s) {
    EXPECT_EQ(reply.status, status);
    EXPECT_EQ(reply.header("retry-after"), retry_after_s);
    const Problem problem = read_problem(reply.body);
    EXPECT_EQ(problem.code, code);
    EXPECT_TRUE(problem.retryable);
  };
  StoreOptions small;
  small.max_queued = 1;
  Service queue(Service::roomy(), {}, small);
  queue.submit();
  const std::string order = Service::order(queue.upload("scene"));
  expect_refusal(post(queue.port, "/v1/jobs", order), 429, "queue_full", "10");

  StoreOptions full;
  full.min_free_bytes = UINT64_MAX;
  Service disk(Service::roomy(), {}, full);
  const std::string digest = sha256_digest("x", 1);
  expect_refusal(request(disk.port, "PUT", "/v1/blobs/" + digest, "x"), 507, "storage_full", "60");
}

TEST(Health, WorkersAndWhatTheirSandboxesLackCanBeSeen) {
  Service service;
  service.store->enlist("whole-1", {});
  service.store->enlist("torn-2", {"landlock", "namespaces"});
  const std::string verbose = get(service.port, "/readyz?verbose").body;
  EXPECT_NE(verbose.find("workers 2\n"), std::string::npos) << verbose;
  EXPECT_NE(verbose.find("[!] sandbox: the ovens of worker torn-2 lack landlock, namespaces"),
            std::string::npos)
      << verbose;
  EXPECT_EQ(verbose.find("whole-1"), std::string::npos);
  const std::string metrics = get(service.port, "/metrics").body;
  EXPECT_NE(metrics.find("lightkiln_workers 2\n"), std::string::npos);
  EXPECT_NE(metrics.find("lightkiln_workers_without_sandbox_layer{layer=\"landlock\"} 1\n"),
            std::string::npos);
  const std::vector<WorkerMessage> workers = read_workers(get(service.port, "/v1/workers").body);
  ASSERT_EQ(workers.size(), 2u);
  EXPECT_EQ(workers[0].name, "torn-2");
  EXPECT_EQ(workers[0].missing_sandbox_layers,
            (std::vector<std::string>{"landlock", "namespaces"}));
  EXPECT_EQ(workers[1].missing_sandbox_layers.size(), 0u);
}

}  // namespace
}  // namespace lightkiln::test
