// The API over a real socket and a real store: every route, happy and unhappy.

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <sys/socket.h>

#include "proto/problem.h"
#include "tests/http/raw_client.h"
#include "tests/http/service.h"

namespace lightkiln::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

const std::string kNoJob = "/v1/jobs/00000000000000000000000000";

class ApiTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { shared = new Service(); }
  static void TearDownTestSuite() { delete shared; }
  void TearDown() override { EXPECT_EQ(get(port, "/livez").status, 200); }

  Problem expect_problem(const RawReply& reply, int status, const std::string& code) {
    EXPECT_EQ(reply.status, status) << reply.body;
    EXPECT_EQ(reply.header("content-type"), kProblemMediaType);
    const Problem problem = read_problem(reply.body);
    EXPECT_EQ(problem.status, status);
    EXPECT_EQ(problem.code, code);
    EXPECT_EQ(problem.instance, "urn:request:" + reply.header("x-request-id"));
    EXPECT_EQ(problem.retryable, !reply.header("retry-after").empty());
    EXPECT_EQ(problem.detail.find(service.folder.path().string()), std::string::npos);
    return problem;
  }
  std::string baked() {
    const std::string id = service.submit();
    service.work();
    EXPECT_EQ(service.store->find_job(id)->state, JobState::succeeded);
    return id;
  }
  static std::string path(const std::string& id) { return "/v1/jobs/" + id; }

  static inline Service* shared = nullptr;
  Service& service = *shared;
  const int port = service.port;
};

TEST_F(ApiTest, AnOrderIsAcceptedShownAndFinished) {
  const std::string digest = service.upload("a scene");
  const RawReply accepted = post(port, "/v1/jobs", Service::order(digest, "first"));
  ASSERT_EQ(accepted.status, 202) << accepted.body;
  EXPECT_EQ(accepted.header("content-type"), "application/json");
  EXPECT_EQ(accepted.header("retry-after"), "1");
  EXPECT_FALSE(accepted.header("etag").empty());
  EXPECT_FALSE(accepted.header("date").empty());
  const JobMessage job = read_job(accepted.body);
  EXPECT_EQ(accepted.header("location"), path(job.id));
  EXPECT_EQ(job.state, "queued");
  EXPECT_FALSE(job.terminal);
  EXPECT_EQ(job.name, "first");
  EXPECT_EQ(job.kind, "ambient_occlusion");
  EXPECT_FALSE(job.reason.empty());
  EXPECT_EQ(job.quality.target, 0.02);

  const RawReply shown = get(port, path(job.id));
  EXPECT_EQ(shown.status, 200);
  EXPECT_EQ(shown.body, accepted.body);
  EXPECT_EQ(shown.header("etag"), accepted.header("etag"));

  service.work();
  const JobMessage done = read_job(get(port, path(job.id)).body);
  EXPECT_EQ(done.state, "succeeded");
  EXPECT_TRUE(done.terminal);
  EXPECT_EQ(done.progress.fraction, 1);
  EXPECT_EQ(done.artifacts.size(), 2u);
  EXPECT_FALSE(done.plan_json.empty());
  EXPECT_GT(done.finished_ms, 0);
}

TEST_F(ApiTest, APlanIsAJobThatBakesNothing) {
  const std::string digest = service.upload("another scene");
  const RawReply accepted = post(port, "/v1/plans", Service::order(digest));
  ASSERT_EQ(accepted.status, 202);
  const JobMessage job = read_job(accepted.body);
  EXPECT_TRUE(job.plan_only);
  service.work();
  EXPECT_EQ(read_job(get(port, path(job.id)).body).state, "succeeded");
  EXPECT_EQ(get(port, path(job.id) + "/plan").status, 200);
}

TEST_F(ApiTest, AllFaultsOfAnOrderComeAtOnce) {
  const std::string wrong =
      R"({"spec":{"kind":"ambient_occlusion","inputs":{"scene":"nonsense"},)"
      R"("parameters":{"max_distnace":3,"falloff":7},"accuracy":{"target_error":-1}},"priority":"x"})";
  for (const char* route : {"/v1/jobs", "/v1/jobs:validate", "/v1/plans"}) {
    const Problem problem = expect_problem(post(port, route, wrong), 422, "invalid_spec");
    std::set<std::string> pointers;
    for (const SpecFault& fault : problem.errors) pointers.insert(fault.pointer);
    for (const char* pointer :
         {"/spec/inputs/scene", "/spec/parameters/max_distnace", "/spec/parameters/falloff",
          "/spec/accuracy/target_error", "/priority"})
      EXPECT_TRUE(pointers.count(pointer)) << pointer << " in " << route;
  }
}

TEST_F(ApiTest, OrdersThatAreNoJsonAreRefused) {
  expect_problem(post(port, "/v1/jobs", "{"), 400, "malformed_json");
  expect_problem(post(port, "/v1/jobs", "{}{}"), 400, "malformed_json");
  EXPECT_EQ(post(port, "/v1/jobs", std::string(100000, '[')).status / 100, 4);
  EXPECT_EQ(post(port, "/v1/jobs", "").status / 100, 4);
  expect_problem(request(port, "POST", "/v1/jobs", "{}"), 415, "unsupported_media_type");
  expect_problem(request(port, "POST", "/v1/jobs", "{}", "Content-Type: text/json\r\n"), 415,
                 "unsupported_media_type");
  expect_problem(post(port, "/v1/jobs", std::string((1 << 20) + 1, ' ')), 413, "too_large");
  EXPECT_EQ(
      request(port, "POST", "/v1/jobs:validate", Service::order("sha256:" + std::string(64, '0')),
              "Content-Type: Application/JSON; charset=utf-8\r\n")
          .status,
      200);
}

TEST_F(ApiTest, MissingInputsAreNamedWhereTheSpecNamesThem) {
  const std::string unknown = "sha256:" + std::string(64, 'e');
  const Problem problem =
      expect_problem(post(port, "/v1/jobs", Service::order(unknown)), 422, "invalid_spec");
  ASSERT_EQ(problem.errors.size(), 1u);
  EXPECT_EQ(problem.errors[0].pointer, "/spec/inputs/scene");
  EXPECT_EQ(problem.errors[0].code, "missing");

  const RawReply valid = post(port, "/v1/jobs:validate", Service::order(unknown));
  EXPECT_EQ(valid.status, 200);
  const ValidationMessage message = read_validation(valid.body);
  EXPECT_EQ(message.missing_blobs, std::vector<std::string>{unknown});
  EXPECT_TRUE(is_digest(message.spec_digest));
  EXPECT_NE(message.spec_json.find("\"falloff\":\"none\""), std::string::npos);
}

TEST_F(ApiTest, AnIdempotencyKeyMakesOneJobOfManySubmissions) {
  const std::string order = Service::order(service.upload("idempotent scene"));
  const std::string key = "Idempotency-Key: key-1\r\n";
  const RawReply first = post(port, "/v1/jobs", order, key);
  const RawReply second = post(port, "/v1/jobs", order, key);
  ASSERT_EQ(first.status, 202);
  EXPECT_EQ(second.status, 202);
  EXPECT_EQ(read_job(first.body).id, read_job(second.body).id);
  EXPECT_EQ(first.header("idempotency-replayed"), "");
  EXPECT_EQ(second.header("idempotency-replayed"), "true");
  const std::string other = Service::order(service.upload("idempotent scene"), "renamed");
  expect_problem(post(port, "/v1/jobs", other, key), 409, "conflict");
  expect_problem(post(port, "/v1/plans", order, key), 409, "conflict");
  EXPECT_EQ(
      post(port, "/v1/jobs", order, "Idempotency-Key: " + std::string(64, 'k') + "\r\n").status,
      202);
  expect_problem(post(port, "/v1/jobs", order, "Idempotency-Key: " + std::string(65, 'k') + "\r\n"),
                 400, "bad_request");
  service.work();
}

TEST_F(ApiTest, AnUnchangedJobAnswers304) {
  const std::string id = service.submit();
  const std::string tag = get(port, path(id)).header("etag");
  const RawReply same = get(port, path(id), "If-None-Match: \"x\", " + tag + "\r\n");
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.header("etag"), tag);
  EXPECT_EQ(same.header("content-length"), "");
  EXPECT_EQ(get(port, path(id), "If-None-Match: W/" + tag + "\r\n").status, 304);
  service.work();
  const RawReply changed = get(port, path(id), "If-None-Match: " + tag + "\r\n");
  EXPECT_EQ(changed.status, 200);
  EXPECT_NE(changed.header("etag"), tag);
}

TEST_F(ApiTest, AnUnchangedListAnswers304) {
  const std::string tag = get(port, "/v1/jobs").header("etag");
  ASSERT_FALSE(tag.empty());
  EXPECT_EQ(get(port, "/v1/jobs", "If-None-Match: " + tag + "\r\n").status, 304);
  service.submit();
  EXPECT_EQ(get(port, "/v1/jobs", "If-None-Match: " + tag + "\r\n").status, 200);
  service.work();
}

TEST_F(ApiTest, PreferWaitWaitsUntilTheEndOrTheTime) {
  const std::string id = service.submit();
  auto start = steady_clock::now();
  RawReply reply = get(port, path(id), "Prefer: respond-async, wait=1\r\n");
  EXPECT_GE(steady_clock::now() - start, milliseconds(900));
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.header("preference-applied"), "wait=1");
  EXPECT_EQ(read_job(reply.body).state, "queued");

  std::thread worker([&] {
    std::this_thread::sleep_for(milliseconds(300));
    service.work();
  });
  start = steady_clock::now();
  reply = get(port, path(id), "Prefer: wait=1000\r\n");
  EXPECT_LT(steady_clock::now() - start, milliseconds(10000));
  EXPECT_EQ(reply.header("preference-applied"), "wait=60");
  EXPECT_EQ(read_job(reply.body).state, "succeeded");
  worker.join();

  for (const char* nonsense : {"wait=x", "wait=-1", "wait=", "wait=1x", "tea=1"})
    EXPECT_EQ(get(port, path(id), std::string("Prefer: ") + nonsense + "\r\n")
                  .header("preference-applied"),
              "");
  expect_problem(get(port, kNoJob, "Prefer: wait=5\r\n"), 404, "not_found");
}

TEST_F(ApiTest, PreferWaitWithATagWaitsForAnyChange) {
  const std::string id = service.submit();
  const std::string tag = get(port, path(id)).header("etag");
  const std::string headers = "Prefer: wait=1\r\nIf-None-Match: " + tag + "\r\n";
  EXPECT_EQ(get(port, path(id), headers).status, 304);
  std::thread worker([&] {
    std::this_thread::sleep_for(milliseconds(200));
    service.take();
  });
  const RawReply reply = get(port, path(id), "Prefer: wait=20\r\nIf-None-Match: " + tag + "\r\n");
  worker.join();
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(read_job(reply.body).state, "running");
  EXPECT_EQ(request(port, "POST", path(id) + ":cancel").status, 200);
}

TEST_F(ApiTest, ASubmissionMayWaitForItsEnd) {
  const std::string order = Service::order(service.upload("awaited scene"));
  std::thread worker([&] {
    for (int i = 0; i < 100; ++i) {
      service.work();
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  const RawReply reply = post(port, "/v1/jobs", order, "Prefer: wait=20\r\n");
  EXPECT_EQ(reply.status, 202);
  EXPECT_EQ(reply.header("preference-applied"), "wait=20");
  EXPECT_EQ(reply.header("retry-after"), "");
  EXPECT_EQ(read_job(reply.body).state, "succeeded");
  worker.join();
}

TEST_F(ApiTest, MoreWaitersThanPlacesAreAnsweredAtOnce) {
  ApiOptions options;
  options.max_waiters = 2;
  Service small(Service::roomy(), options);
  const std::string id = small.submit();
  RawClient first(small.port), second(small.port);
  const std::string wait =
      "GET " + path(id) + " HTTP/1.1\r\nHost: localhost\r\nPrefer: wait=2\r\n\r\n";
  first.send(wait);
  second.send(wait);
  std::this_thread::sleep_for(milliseconds(300));
  const RawReply third = get(small.port, path(id), "Prefer: wait=2\r\n");
  EXPECT_EQ(third.status, 200);
  EXPECT_EQ(third.header("preference-applied"), "");
  EXPECT_EQ(first.receive().header("preference-applied"), "wait=2");
  EXPECT_EQ(second.receive().status, 200);
}

TEST_F(ApiTest, JobsAreListedNewestFirstPageByPage) {
  Service own;
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(own.submit());
  std::reverse(ids.begin(), ids.end());
  std::vector<std::string> seen;
  std::string target = "/v1/jobs?limit=2&state=queued";
  for (int pages = 0; !target.empty(); ++pages) {
    ASSERT_LT(pages, 3);
    const RawReply reply = get(own.port, target);
    ASSERT_EQ(reply.status, 200) << reply.body;
    const JobPage page = read_job_page(reply.body);
    for (const JobMessage& job : page.items) seen.push_back(job.id);
    target.clear();
    if (page.next.empty()) {
      EXPECT_EQ(reply.header("link"), "");
      continue;
    }
    const std::string link = reply.header("link");
    ASSERT_TRUE(link.ends_with(">; rel=\"next\"")) << link;
    target = link.substr(1, link.find('>') - 1);
    EXPECT_NE(target.find("after=" + page.next), std::string::npos);
  }
  EXPECT_EQ(seen, ids);
}

TEST_F(ApiTest, ListsAreFiltered) {
  Service own;
  const std::string digest = own.upload("filtered");
  std::string order = Service::order(digest, "Hotel & room");
  order.insert(order.size() - 1, R"(,"labels":{"shot":"a:b c"})");
  const std::string id = read_job(post(own.port, "/v1/jobs", order).body).id;
  own.submit();
  const auto count = [&](const std::string& query) {
    const RawReply reply = get(own.port, "/v1/jobs?" + query);
    EXPECT_EQ(reply.status, 200) << query << reply.body;
    return read_job_page(reply.body).items.size();
  };
  EXPECT_EQ(count(""), 2u);
  EXPECT_EQ(count("kind=ambient_occlusion"), 2u);
  EXPECT_EQ(count("kind=probes"), 0u);
  EXPECT_EQ(count("text=Hotel+%26"), 1u);
  EXPECT_EQ(count("text=" + id), 1u);
  EXPECT_EQ(count("label=shot:a:b%20c"), 1u);
  EXPECT_EQ(count("label=shot:x"), 0u);
  EXPECT_EQ(count("state=failed"), 0u);
  EXPECT_EQ(count("text=%25"), 0u) << "no wildcard";
  for (const char* wrong : {"limit=0", "limit=501", "limit=x", "limit=1x", "state=tea", "kind=tea",
                            "label=x", "lmit=1"})
    expect_problem(get(own.port, std::string("/v1/jobs?") + wrong), 400, "bad_request");
}

TEST_F(ApiTest, JobsAreCancelledRetriedAndForgotten) {
  const std::string id = service.submit();
  expect_problem(request(port, "POST", path(id) + ":retry"), 409, "conflict");
  const RawReply cancelled = request(port, "POST", path(id) + ":cancel");
  EXPECT_EQ(cancelled.status, 200);
  EXPECT_EQ(read_job(cancelled.body).state, "cancelled");
  expect_problem(request(port, "POST", path(id) + ":cancel"), 409, "conflict");
  const RawReply retried = request(port, "POST", path(id) + ":retry");
  EXPECT_EQ(retried.status, 200);
  EXPECT_EQ(read_job(retried.body).state, "queued");
  service.take();
  expect_problem(request(port, "DELETE", path(id)), 409, "conflict");
  EXPECT_EQ(request(port, "POST", path(id) + ":cancel").status, 200);
  const RawReply gone = request(port, "DELETE", path(id));
  EXPECT_EQ(gone.status, 204);
  EXPECT_EQ(gone.header("content-length"), "");
  expect_problem(get(port, path(id)), 404, "not_found");
  for (const char* verb : {":cancel", ":retry"})
    expect_problem(request(port, "POST", kNoJob + verb), 404, "not_found");
  expect_problem(request(port, "DELETE", kNoJob), 404, "not_found");
}

TEST_F(ApiTest, PlanAccuracyAndConvergenceFollowTheJob) {
  const std::string id = service.submit();
  expect_problem(get(port, path(id) + "/plan"), 404, "not_found");
  expect_problem(get(port, path(id) + "/accuracy"), 404, "not_found");
  EXPECT_EQ(get(port, path(id) + "/convergence").status, 200) << "empty, but known";
  service.work();
  for (const char* part : {"/plan", "/accuracy", "/convergence", "/artifacts"}) {
    const RawReply reply = get(port, path(id) + part);
    EXPECT_EQ(reply.status, 200) << part << reply.body;
    EXPECT_EQ(reply.header("content-type"), "application/json");
    EXPECT_EQ(get(port, path(id) + part, "If-None-Match: " + reply.header("etag") + "\r\n").status,
              304)
        << part;
    expect_problem(get(port, kNoJob + part), 404, "not_found");
  }
  const std::string convergence = get(port, path(id) + "/convergence").body;
  EXPECT_NE(convergence.find("\"elements\":20"), std::string::npos) << convergence;
  EXPECT_NE(convergence.find("\"samples\":64"), std::string::npos) << convergence;
}

TEST_F(ApiTest, EventsAreReadAfterANumber) {
  const std::string id = baked();
  const EventPage all = read_event_page(get(port, path(id) + "/events").body);
  ASSERT_GT(all.items.size(), 4u);
  const EventPage rest = read_event_page(
      get(port, path(id) + "/events?limit=2&after=" + std::to_string(all.items[0].sequence)).body);
  ASSERT_EQ(rest.items.size(), 2u);
  EXPECT_EQ(rest.items[0].sequence, all.items[1].sequence);
  EXPECT_EQ(rest.next_after, all.items[2].sequence);
  const std::string end = std::to_string(all.next_after);
  const EventPage none = read_event_page(get(port, path(id) + "/events?after=" + end).body);
  EXPECT_TRUE(none.items.empty());
  EXPECT_EQ(none.next_after, all.next_after);
  expect_problem(get(port, path(id) + "/events?after=-1"), 400, "bad_request");
  expect_problem(get(port, path(id) + "/events?limit=501"), 400, "bad_request");
  expect_problem(get(port, kNoJob + "/events"), 404, "not_found");
}

TEST_F(ApiTest, ArtifactsComeWholeInPartAndAsHeads) {
  const std::string id = baked();
  const std::string target = path(id) + "/artifacts/ao.exr";
  const std::string bytes = artifact_bytes();
  const RawReply whole = get(port, target);
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, bytes);
  EXPECT_EQ(whole.header("content-type"), "image/x-exr");
  EXPECT_EQ(whole.header("accept-ranges"), "bytes");
  EXPECT_EQ(whole.header("content-disposition"), "attachment; filename=\"ao.exr\"");
  EXPECT_EQ(whole.header("x-content-type-options"), "nosniff");
  const std::string digest = sha256_digest(bytes.data(), bytes.size());
  EXPECT_EQ(whole.header("etag"), '"' + digest + '"');
  EXPECT_EQ(whole.header("repr-digest"), repr_digest(digest));
  EXPECT_EQ(get(port, path(id) + "/artifacts/view.png").header("content-disposition"),
            "inline; filename=\"view.png\"");

  const RawReply head = request(port, "HEAD", target);
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.header("content-length"), "1000");
  EXPECT_EQ(head.header("repr-digest"), repr_digest(digest));

  const auto range = [&](const std::string& text, const std::string& more = "") {
    return get(port, target, "Range: " + text + "\r\n" + more);
  };
  const RawReply part = range("bytes=900-5000");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.header("content-range"), "bytes 900-999/1000");
  EXPECT_EQ(part.header("content-length"), "100");
  EXPECT_EQ(part.body, bytes.substr(900));
  EXPECT_EQ(range("bytes=0-0").body, bytes.substr(0, 1));
  EXPECT_EQ(range("bytes=-10").body, bytes.substr(990));
  EXPECT_EQ(range("bytes=10-").body, bytes.substr(10));
  EXPECT_EQ(range("pages=1-2").status, 200);
  const RawReply beyond = range("bytes=5000-");
  expect_problem(beyond, 416, "range_not_satisfiable");
  EXPECT_EQ(beyond.header("content-range"), "bytes */1000");
  EXPECT_EQ(range("bytes=0-1,5-6").status, 416);
  EXPECT_EQ(range("bytes=0-9", "If-Range: \"other\"\r\n").status, 200);
  EXPECT_EQ(range("bytes=0-9", "If-Range: \"" + digest + "\"\r\n").status, 206);
  EXPECT_EQ(range("bytes=0-9", "If-Range: W/\"" + digest + "\"\r\n").status, 200);
  EXPECT_EQ(get(port, target, "If-None-Match: \"" + digest + "\"\r\n").status, 304);
  EXPECT_EQ(get(port, target, "If-None-Match: *\r\n").status, 304);

  expect_problem(get(port, path(id) + "/artifacts/none.exr"), 404, "not_found");
  expect_problem(get(port, kNoJob + "/artifacts/ao.exr"), 404, "not_found");
  EXPECT_EQ(get(port, path(id) + "/artifacts/..%2fao.exr").status, 400);
}

TEST_F(ApiTest, BlobsAreStoredOnceUnderTheirDigest) {
  const std::string bytes = "blob bytes";
  const std::string digest = sha256_digest(bytes.data(), bytes.size());
  const std::string target = "/v1/blobs/" + digest;
  expect_problem(get(port, target), 404, "not_found");
  EXPECT_EQ(request(port, "HEAD", target).status, 404);
  const RawReply missing = post(port, "/v1/blobs:missing", write_digests({digest, digest}));
  EXPECT_EQ(read_missing(missing.body), std::vector<std::string>{digest});

  const RawReply stored = request(port, "PUT", target, bytes);
  EXPECT_EQ(stored.status, 201) << stored.body;
  EXPECT_EQ(stored.header("location"), target);
  EXPECT_EQ(request(port, "PUT", target, bytes).status, 200);
  EXPECT_EQ(get(port, target).body, bytes);
  EXPECT_EQ(request(port, "HEAD", target).header("content-length"), "10");
  EXPECT_EQ(get(port, target, "Range: bytes=5-\r\n").body, "bytes");
  EXPECT_TRUE(read_missing(post(port, "/v1/blobs:missing", write_digests({digest})).body).empty());

  expect_problem(request(port, "PUT", target, "other bytes"), 422, "invalid_input");
  EXPECT_EQ(get(port, target).body, bytes);
  const std::string right = "Content-Digest: " + repr_digest(digest) + "\r\n";
  const std::string wrong =
      "Content-Digest: " + repr_digest("sha256:" + std::string(64, '0')) + "\r\n";
  EXPECT_EQ(request(port, "PUT", target, bytes, right).status, 200);
  expect_problem(request(port, "PUT", target, bytes, wrong), 422, "invalid_input");
  for (const char* name : {"sha256:00", "md5:00", "x", "sha256:"})
    EXPECT_EQ(get(port, std::string("/v1/blobs/") + name).status, 400) << name;
  expect_problem(post(port, "/v1/blobs:missing", R"({"digests":["x",7]})"), 422, "invalid_spec");
}

TEST_F(ApiTest, EmptyAndLargeBlobsArrive) {
  const std::string empty = sha256_digest("", 0);
  EXPECT_EQ(request(port, "PUT", "/v1/blobs/" + empty, "", "Content-Length: 0\r\n").status, 201);
  EXPECT_EQ(get(port, "/v1/blobs/" + empty).body, "");
  std::string large(20 << 20, '\0');
  for (size_t i = 0; i < large.size(); ++i) large[i] = static_cast<char>(i * 7 + i / 1000);
  const std::string digest = sha256_digest(large.data(), large.size());
  EXPECT_EQ(request(port, "PUT", "/v1/blobs/" + digest, large).status, 201);
  EXPECT_TRUE(get(port, "/v1/blobs/" + digest).body == large);
  large[5] = 'x';
  expect_problem(request(port, "PUT", "/v1/blobs/" + digest, large), 422, "invalid_input");
}

TEST_F(ApiTest, UploadsAreAskedToContinue) {
  const std::string bytes(2 << 20, 'c');
  const std::string digest = sha256_digest(bytes.data(), bytes.size());
  const std::string start = "PUT /v1/blobs/" + digest + " HTTP/1.1\r\nHost: localhost\r\n" +
                            "Expect: 100-continue\r\nContent-Length: ";
  RawClient client(port);
  client.send(start + std::to_string(bytes.size()) + "\r\n\r\n");
  char word[26] = {};
  ASSERT_EQ(::recv(client.fd(), word, 25, MSG_WAITALL), 25);
  EXPECT_STREQ(word, "HTTP/1.1 100 Continue\r\n\r\n");
  client.send(bytes);
  EXPECT_EQ(client.receive().status, 201);
  client.send(start + "999999999999\r\n\r\n");
  EXPECT_EQ(client.receive().status, 413) << "refused before it is sent";
}

TEST_F(ApiTest, TheServiceDescribesItself) {
  EXPECT_EQ(get(port, "/readyz").body, "ok\n");
  EXPECT_NE(get(port, "/readyz?verbose").body.find("[+] store ok"), std::string::npos);
  EXPECT_EQ(read_version(get(port, "/version").body).name, "lightkiln");
  EXPECT_NE(get(port, "/v1/kinds").body.find("ambient_occlusion"), std::string::npos);
  const RawReply openapi = get(port, "/openapi.json");
  const auto file = read_file(std::string(LIGHTKILN_SOURCE_DIR) + "/proto/openapi.json");
  EXPECT_TRUE(to_bytes(openapi.body) == file);
  EXPECT_EQ(openapi.header("content-type"), "application/json");
  EXPECT_EQ(get(port, "/openapi.json", "If-None-Match: " + openapi.header("etag") + "\r\n").status,
            304);
  const RawReply head = request(port, "HEAD", "/livez");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.header("content-length"), "3");
}

TEST_F(ApiTest, MetricsCountJobsAndRequests) {
  service.submit();
  service.work();
  const RawReply reply = get(port, "/metrics");
  EXPECT_NE(reply.body.find("# TYPE lightkiln_events_total counter\n"), std::string::npos);
  EXPECT_EQ(reply.status, 200);
  EXPECT_TRUE(reply.header("content-type").starts_with("text/plain"));
  EXPECT_NE(reply.body.find("lightkiln_jobs{kind=\"ambient_occlusion\",state=\"succeeded\"} "),
            std::string::npos)
      << reply.body;
  EXPECT_NE(reply.body.find("lightkiln_http_requests_total{method=\"POST\",status=\"202\"} "),
            std::string::npos);
  request(port, "BREW", "/v1/jobs");
  EXPECT_EQ(get(port, "/metrics").body.find("BREW"), std::string::npos);
}

TEST_F(ApiTest, EveryProblemHasAPage) {
  for (const ProblemKind& kind : problem_kinds()) {
    const RawReply page = get(port, std::string("/problems/") + kind.code);
    EXPECT_EQ(page.status, 200) << kind.code;
    EXPECT_NE(page.body.find(kind.code), std::string::npos);
  }
  expect_problem(get(port, "/problems/tea"), 404, "not_found");
}

TEST_F(ApiTest, TheDashboardIsServedWithItsPolicy) {
  const RawReply page = get(port, "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.header("content-type"), "text/html; charset=utf-8");
  const std::string policy = page.header("content-security-policy");
  for (const char* rule : {"default-src 'none'", "script-src 'self'", "frame-ancestors 'none'"})
    EXPECT_NE(policy.find(rule), std::string::npos) << rule;
  EXPECT_EQ(policy.find("unsafe"), std::string::npos);
  EXPECT_EQ(page.header("x-content-type-options"), "nosniff");
  EXPECT_EQ(get(port, "/index.html").body, page.body);
  EXPECT_EQ(get(port, "/app.js").header("content-type"), "text/javascript; charset=utf-8");
  EXPECT_EQ(get(port, "/", "If-None-Match: " + page.header("etag") + "\r\n").status, 304);
  expect_problem(get(port, "/none.js"), 404, "not_found");
}

TEST_F(ApiTest, UnknownPathsAndMethodsSayWhatThereIs) {
  expect_problem(get(port, "/v1/tea"), 404, "not_found");
  expect_problem(get(port, "/v1/jobs/"), 404, "not_found");
  expect_problem(get(port, "//"), 404, "not_found");
  const RawReply wrong = request(port, "PUT", "/v1/jobs");
  expect_problem(wrong, 405, "method_not_allowed");
  EXPECT_EQ(wrong.header("allow"), "POST, GET, HEAD");
  expect_problem(request(port, "OPTIONS", "/v1/jobs"), 405, "method_not_allowed");
  expect_problem(get(port, "/livez?x=1"), 400, "bad_request");
}

TEST_F(ApiTest, RequestsKeepTheNameThatAClientGivesThem) {
  EXPECT_EQ(get(port, "/livez", "X-Request-Id: my-request.7\r\n").header("x-request-id"),
            "my-request.7");
  const std::string own = get(port, "/livez", "X-Request-Id: <script>\r\n").header("x-request-id");
  EXPECT_EQ(own.size(), 16u);
  EXPECT_NE(get(port, "/livez").header("x-request-id"), own);
}

TEST_F(ApiTest, AConnectionServesManyRequests) {
  RawClient client(port);
  for (int i = 0; i < 100; ++i) {
    client.send("GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const RawReply reply = client.receive();
    ASSERT_EQ(reply.status, 200);
    ASSERT_EQ(reply.header("connection"), "");
  }
}

}  // namespace
}  // namespace lightkiln::test
