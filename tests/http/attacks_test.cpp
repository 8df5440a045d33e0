// Every attack that the HTTP library alone does not stand, over a real socket, each followed by a
// healthy daemon.

#include <atomic>
#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zlib.h>

#include "proto/problem.h"
#include "tests/http/raw_client.h"
#include "tests/http/service.h"

namespace lightkiln::test {
namespace {

using std::chrono::milliseconds;

FenceLimits hasty() {
  FenceLimits limits = Service::roomy();
  limits.head_ms = 700;
  limits.grace_ms = 500;
  limits.stall_ms = 1500;
  limits.drain_ms = 500;
  return limits;
}

// One daemon for all attacks: what one of them left behind would show in the next.
class Attacks : public testing::Test {
 protected:
  static void SetUpTestSuite() { shared = new Service(hasty()); }
  static void TearDownTestSuite() { delete shared; }
  void TearDown() override { expect_healthy(); }

  void expect_healthy() {
    const RawReply reply = get(service.port, "/livez");
    EXPECT_EQ(reply.status, 200);
    EXPECT_EQ(reply.body, "ok\n");
  }

  // Sends bytes and expects one problem reply with this status, then the end of the connection.
  RawReply expect_refused(const std::string& bytes, int status) {
    RawClient client(service.port);
    client.send(bytes);
    const RawReply reply = client.receive();
    EXPECT_EQ(reply.status, status) << bytes.substr(0, 200);
    EXPECT_EQ(reply.header("content-type"), kProblemMediaType);
    EXPECT_EQ(reply.header("connection"), "close");
    EXPECT_FALSE(reply.header("x-request-id").empty());
    EXPECT_EQ(reply.header("exception_what"), "");
    const Problem problem = read_problem(reply.body);
    EXPECT_EQ(problem.status, status);
    EXPECT_FALSE(problem.detail.empty());
    client.finish_sending();
    EXPECT_TRUE(client.closed_within(3000));
    return reply;
  }

  static std::string head(const std::string& first, const std::string& headers) {
    return first + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
  }

  static inline Service* shared = nullptr;
  Service& service = *shared;
};

uint64_t resident_bytes() {
  std::ifstream in("/proc/self/statm");
  uint64_t all = 0, resident = 0;
  in >> all >> resident;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

TEST_F(Attacks, AThousandSlowHeadsHoldNothingUp) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  const int count = files.rlim_cur > 2600 ? 1000 : static_cast<int>(files.rlim_cur) / 3;
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < count; ++i) {
    slow.push_back(std::make_unique<RawClient>(service.port));
    slow.back()->send("GET /livez HTTP/1.1\r\nHo");
  }
  for (int i = 0; i < 20; ++i) expect_healthy();
  for (auto& client : slow) client->send("s");
  expect_healthy();
  // Each is told why, and closed, whether it goes on dripping or not.
  for (auto& client : slow) {
    const RawReply reply = client->receive();
    EXPECT_TRUE(reply.status == 408 || reply.status == 0) << reply.status;
  }
}

TEST_F(Attacks, SlowHeadsMakeRoomForOthersWhenConnectionsRunOut) {
  Service small{FenceLimits{}};
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 300; ++i) {
    slow.push_back(std::make_unique<RawClient>(small.port));
    slow.back()->send("GET /livez HTTP/1.1\r\nHo");
  }
  EXPECT_EQ(get(small.port, "/livez").status, 200) << "with 32 places for this address";
}

TEST_F(Attacks, ChunkedBodiesAreNotRead) {
  const std::string start = head("POST /v1/jobs",
                                 "Content-Type: application/json\r\n"
                                 "Transfer-Encoding: chunked\r\n");
  const std::string chunk = "100000\r\n" + std::string(1 << 20, 'x') + "\r\n";
  std::string all = start;
  for (int i = 0; i < 4; ++i) all += chunk;
  expect_refused(all + "0\r\n\r\n", 411);
  expect_refused(
      head("PUT /v1/blobs/sha256:" + std::string(64, '0'), "Transfer-Encoding: chunked\r\n") +
          "-1\r\n",
      411);
}

TEST_F(Attacks, GzipBombsAreNotInflated) {
  std::string bomb(64 << 20, '\0');
  uLongf size = compressBound(bomb.size());
  std::string packed(size, '\0');
  ASSERT_EQ(compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                      reinterpret_cast<const Bytef*>(bomb.data()), bomb.size(), 9),
            Z_OK);
  packed.resize(size);
  const uint64_t before = resident_bytes();
  for (const char* coding : {"gzip", "deflate", "br", "x-gzip", "identity"})
    expect_refused(head("POST /v1/jobs", std::string("Content-Type: application/json\r\n"
                                                     "Content-Encoding: ") +
                                             coding + "\r\nContent-Length: " +
                                             std::to_string(packed.size()) + "\r\n") +
                       packed,
                   415);
  EXPECT_LT(resident_bytes(), before + (16 << 20));
}

TEST_F(Attacks, ManyRangesAreRefusedBeforeAnythingIsRead) {
  const std::string digest = service.upload(std::string(4 << 20, 'x'));
  std::string ranges = "bytes=0-";
  for (int i = 0; i < 300; ++i) ranges += ",0-";
  const uint64_t before = resident_bytes();
  expect_refused(head("GET /v1/blobs/" + digest, "Range: " + ranges + "\r\n"), 416);
  expect_refused(head("GET /v1/blobs/" + digest, "Range: bytes=0-0,2-2\r\n"), 416);
  expect_refused(head("GET /livez", "Range: bytes=" + std::string(8000, '1') + "-\r\n"), 416);
  EXPECT_LT(resident_bytes(), before + (16 << 20));
}

TEST_F(Attacks, DrippedBodiesAreCutOff) {
  for (const char* first : {"POST /v1/jobs", "PUT /v1/blobs/sha256:"}) {
    const bool blob = first[1] == 'U';
    RawClient client(service.port);
    // The upload is long enough to hold a pool thread, the order is not.
    client.send(head(first + (blob ? std::string(64, '0') : ""),
                     std::string("Content-Type: application/json\r\nContent-Length: ") +
                         (blob ? "50000000" : "1000") + "\r\n") +
                "{");
    for (int i = 0; i < 3; ++i) {
      std::this_thread::sleep_for(milliseconds(100));
      client.send(" ");
    }
    const auto start = std::chrono::steady_clock::now();
    EXPECT_EQ(client.receive().status, 408) << first;
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
    EXPECT_TRUE(client.closed_within(3000));
  }
}

TEST_F(Attacks, SlowUploadsOfOneAddressLeavePlacesToOthers) {
  FenceLimits limits = Service::roomy();
  limits.uploads = 4;
  Service own(limits);
  std::vector<std::unique_ptr<RawClient>> clients;
  // Asks for a place and keeps it: the status that the request to go on is answered with.
  const auto begin = [&](const char* from) {
    clients.push_back(std::make_unique<RawClient>(own.port, from));
    clients.back()->send(head("PUT /v1/blobs/sha256:" + std::string(64, '0'),
                              "Expect: 100-continue\r\nContent-Length: 2000000\r\n"));
    char word[12] = {};
    EXPECT_EQ(::recv(clients.back()->fd(), word, sizeof word, MSG_WAITALL), 12);
    return std::string(word + 9, 3);
  };
  EXPECT_EQ(begin("127.0.0.1"), "100");
  EXPECT_EQ(begin("127.0.0.1"), "100");
  EXPECT_EQ(begin("127.0.0.1"), "503") << "half of the places are taken, all by this address";
  EXPECT_EQ(begin("127.0.0.2"), "100");
  EXPECT_EQ(begin("127.0.0.2"), "100");
  EXPECT_EQ(begin("127.0.0.3"), "503") << "all places are taken";
  clients.erase(clients.begin(), clients.begin() + 2);  // the first address lets go
  std::string next;
  for (int i = 0; i < 100 && next != "100"; ++i) {
    std::this_thread::sleep_for(milliseconds(20));
    next = begin("127.0.0.3");
  }
  EXPECT_EQ(next, "100");
}

TEST_F(Attacks, BodiesOverTheLimitAreNotWaitedFor) {
  expect_refused(head("POST /v1/jobs",
                      "Content-Type: application/json\r\n"
                      "Content-Length: 100000000\r\n") +
                     "{",
                 413);
  expect_refused(
      head("PUT /v1/blobs/sha256:" + std::string(64, '0'), "Content-Length: 99999999999\r\n"), 413);
  expect_refused(head("DELETE /v1/jobs/abc", "Content-Length: 5\r\n") + "hello", 413);
}

// The classic five: each hides a second request in what the first calls its body.
TEST_F(Attacks, NothingIsSmuggled) {
  const std::string hidden = "DELETE /v1/jobs/secret HTTP/1.1\r\nHost: localhost\r\n\r\n";
  const std::string length = "Content-Length: " + std::to_string(hidden.size()) + "\r\n";
  const std::vector<std::pair<std::string, int>> all = {
      {head("GET /livez", length) + hidden, 400},
      {head("POST /v1/jobs", "Transfer-Encoding: gzip, chunked\r\n") + hidden, 411},
      {head("POST /v1/jobs", "Content-Length: 0\r\n" + length) + hidden, 400},
      {head("POST /v1/jobs", "Content-Length: abc\r\n") + hidden, 400},
      {head("DELETE /v1/jobs/x", "Transfer-Encoding: chunked\r\n") + "0\r\n\r\n" + hidden, 411},
  };
  for (const auto& [bytes, status] : all) {
    RawClient client(service.port);
    client.send(bytes);
    EXPECT_EQ(client.receive().status, status) << bytes;
    EXPECT_EQ(client.receive().status, 0) << "a second request was served: " << bytes;
  }
}

TEST_F(Attacks, PipelinedRequestsAreAllAnsweredInOrder) {
  RawClient client(service.port);
  client.send(head("GET /livez", "") + head("GET /version", "") + head("GET /nothing/here", "") +
              head("POST /v1/blobs:missing",
                   "Content-Type: application/json\r\n"
                   "Content-Length: 14\r\n") +
              R"({"digests":[]})" + head("GET /livez", "Connection: close\r\n"));
  EXPECT_EQ(client.receive().body, "ok\n");
  EXPECT_EQ(client.receive().header("content-type"), "application/json");
  EXPECT_EQ(client.receive().status, 404);
  EXPECT_EQ(client.receive().body, R"({"missing":[]})");
  EXPECT_EQ(client.receive().body, "ok\n");
  EXPECT_TRUE(client.closed_within(3000));

  std::string many;
  for (int i = 0; i < 900; ++i) many += "GET /x/y HTTP/1.1\r\nHost: localhost\r\n\r\n";
  RawClient flood(service.port);
  std::thread sender([&] { flood.send(many); });
  for (int i = 0; i < 900; ++i) ASSERT_EQ(flood.receive().status, 404) << i;
  sender.join();
}

TEST_F(Attacks, LongPathsAndHeadsEndEarly) {
  expect_refused("GET /" + std::string(8000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n", 414);
  expect_refused("GET /v1/jobs/" + std::string(8000, 'a'), 414);
  std::string many = "GET /livez HTTP/1.1\r\nHost: localhost\r\n";
  for (int i = 0; i < 50000; ++i) many += "X: 1\r\n";
  expect_refused(many + "\r\n", 431);
  const uint64_t before = resident_bytes();
  expect_refused(
      "GET /livez HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(8 << 20, 'a') + "\r\n\r\n",
      431);
  EXPECT_LT(resident_bytes(), before + (24 << 20)) << "the test's own copy of 8 MiB included";
}

TEST_F(Attacks, OddHeadsAreRefused) {
  const std::string line = "GET /livez HTTP/1.1\r\n";
  expect_refused("GET /a%00b HTTP/1.1\r\nHost: localhost\r\n\r\n", 400);
  expect_refused("GET /..%2fetc%2fpasswd HTTP/1.1\r\nHost: localhost\r\n\r\n", 400);
  expect_refused(line + "\r\n", 400);
  expect_refused(line + "Host: localhost\r\nHost: evil\r\n\r\n", 400);
  expect_refused(line + "Host: localhost\r\nX: a\nY: b\r\n\r\n", 400);
  expect_refused(line + "Host: localhost\r\nREMOTE_ADDR: 10.0.0.1\r\n\r\n", 400);
  expect_refused(line + "Host: localhost\r\nContent-Type: multipart/form-data; boundary=" +
                     std::string(8000, 'x') + "\r\n\r\n",
                 415);
  expect_refused(line + "Host: localhost\r\nExpect: 200-ok\r\n\r\n", 417);
  expect_refused("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 505);
  expect_refused("\x16\x03\x01\x02 a TLS greeting\r\n\r\n", 400);
}

TEST_F(Attacks, AReaderThatStopsReadingIsLetGo) {
  const std::string digest = service.upload(std::string(32 << 20, 'x'));
  std::vector<std::unique_ptr<RawClient>> stalled;
  for (int i = 0; i < 60; ++i) {  // more than there are pool threads
    stalled.push_back(std::make_unique<RawClient>(service.port));
    stalled.back()->send(head("GET /v1/blobs/" + digest, ""));
  }
  expect_healthy();
  std::this_thread::sleep_for(milliseconds(2500));
  EXPECT_THROW(stalled[0]->receive(), std::exception) << "the reply must be cut off";
}

TEST_F(Attacks, APeerThatVanishesLeavesNothingBehind) {
  for (int i = 0; i < 50; ++i) {
    RawClient client(service.port);
    client.send(
        head("PUT /v1/blobs/sha256:" + std::string(64, '0'), "Content-Length: 9000000\r\n") +
        std::string(100000, 'x'));
    const linger now{1, 0};  // a reset, not a goodbye
    setsockopt(client.fd(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
  }
  expect_healthy();
}

// --- through the seam of the fence
// ----------------------------------------------------------------

class Seam : public testing::Test {
 protected:
  int serve(std::function<HttpReply(IncomingRequest&)> handle, FenceLimits limits = hasty()) {
    HttpApplication application;
    application.admit = [](const HttpHead& head) {
      if (head.path == "/admit") throw std::runtime_error("admit failed at /secret/path");
      return Admission{BodyRule::streamed, 1 << 30, std::nullopt};
    };
    application.handle = [handle](IncomingRequest& request) {
      return request.head.path == "/livez" ? HttpReply{} : handle(request);
    };
    fence = std::make_unique<Fence>(limits, application);
    return fence->listen("127.0.0.1", 0);
  }
  std::unique_ptr<Fence> fence;
};

TEST_F(Seam, AThrowingHandlerBecomesAProblemWithoutItsText) {
  for (const int what : {0, 1, 2}) {
    const int port = serve([what](IncomingRequest&) -> HttpReply {
      if (what == 0) throw std::runtime_error("failed at /secret/path");
      if (what == 1) throw Error(ErrorCode::internal, "failed at /secret/path");
      throw 7;
    });
    const RawReply reply = get(port, "/");
    EXPECT_EQ(reply.status, 500);
    EXPECT_EQ(reply.header("exception_what"), "");
    EXPECT_EQ(reply.body.find("secret"), std::string::npos);
    EXPECT_EQ(read_problem(reply.body).code, "internal");
    EXPECT_EQ(get(port, "/admit").status, 500);
    EXPECT_EQ(get(port, "/livez").status, 200);
  }
}

TEST_F(Seam, ABodySourceThatFailsEndsTheConnectionNotTheDaemon) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "file";
  write_file(path, to_bytes("short"));
  const int port = serve([&](IncomingRequest& request) {
    HttpReply reply;
    const bool directory = request.head.path == "/directory";
    const int fd = ::open(directory ? folder.path().c_str() : path.c_str(), O_RDONLY | O_CLOEXEC);
    reply.file = FileBody{own_descriptor(fd), 0, 1 << 20};
    return reply;
  });
  for (const char* target : {"/directory", "/shrunk"}) {
    RawClient client(port);
    client.send(std::string("GET ") + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_ANY_THROW(client.receive()) << target;
    EXPECT_EQ(get(port, "/livez").status, 200);
  }
}

TEST_F(Seam, RepliesCannotBeSplitByTheirHeaders) {
  const int port = serve([](IncomingRequest&) {
    HttpReply reply;
    return reply.set("X-Name", "a\r\nSet-Cookie: b");
  });
  const RawReply reply = get(port, "/");
  EXPECT_EQ(reply.header("set-cookie"), "");
  EXPECT_EQ(reply.header("x-name"), "a??Set-Cookie: b");
}

TEST_F(Seam, AnUnreadUploadDoesNotBecomeTheNextRequest) {
  const int port = serve([](IncomingRequest&) { return HttpReply{}; });
  RawClient client(port);
  const std::string hidden = "GET /hidden HTTP/1.1\r\nHost: localhost\r\n\r\n";
  client.send("PUT / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2000000\r\n\r\n" + hidden);
  EXPECT_EQ(client.receive().header("connection"), "close");
  EXPECT_EQ(client.receive().status, 0);
}

TEST_F(Seam, ASecondFenceOnThePortIsRefused) {
  const int port = serve([](IncomingRequest&) { return HttpReply{}; });
  Fence second(hasty(), {});
  EXPECT_THROW(second.listen("127.0.0.1", port), Error);
}

// A handler that holds its thread until it is released.
struct Turnstile {
  std::atomic<int> entered{0};
  std::atomic<bool> open{false};
  HttpReply operator()(IncomingRequest&) {
    ++entered;
    while (!open) std::this_thread::sleep_for(milliseconds(2));
    return {};
  }
  void await(int count) const {
    while (entered < count) std::this_thread::sleep_for(milliseconds(2));
  }
};
const std::string kHold = "GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n";

TEST_F(Seam, ConnectionsThatAllWorkAreNotTakenAwayAndNewOnesAreTold) {
  FenceLimits limits = hasty();
  limits.connections = 4;
  Turnstile hold;
  const int port = serve([&](IncomingRequest& request) { return hold(request); }, limits);
  std::vector<std::unique_ptr<RawClient>> busy;
  for (int i = 0; i < 4; ++i) {
    busy.push_back(std::make_unique<RawClient>(port));
    busy.back()->send(kHold);
    hold.await(i + 1);
  }
  const RawReply refused = get(port, "/livez");
  EXPECT_EQ(refused.status, 503);
  EXPECT_FALSE(refused.header("retry-after").empty());
  hold.open = true;
  for (auto& client : busy) EXPECT_EQ(client->receive().status, 200);
}

TEST_F(Seam, AFullQueueIsSaidPolitely) {
  FenceLimits limits = hasty();
  limits.threads = 1;
  limits.queue = 1;
  Turnstile hold;
  const int port = serve([&](IncomingRequest& request) { return hold(request); }, limits);
  RawClient first(port), second(port), third(port);
  first.send(kHold);
  hold.await(1);
  // Of two more, one finds the only place in the queue; heads are read in order of arrival.
  second.send(kHold);
  std::this_thread::sleep_for(milliseconds(300));
  third.send(kHold);
  const RawReply refused = third.receive();
  EXPECT_EQ(refused.status, 503);
  EXPECT_FALSE(refused.header("retry-after").empty());
  hold.open = true;
  EXPECT_EQ(first.receive().status, 200);
  EXPECT_EQ(second.receive().status, 200);
}

TEST_F(Seam, StoppingLetsRequestsInHandFinish) {
  std::atomic<bool> entered{false};
  const int port = serve([&](IncomingRequest&) {
    entered = true;
    std::this_thread::sleep_for(milliseconds(300));
    return HttpReply{};
  });
  RawClient working(port), idle(port);
  working.send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
  while (!entered) std::this_thread::sleep_for(milliseconds(5));
  fence->stop(5000);
  EXPECT_EQ(working.receive().status, 200);
  EXPECT_TRUE(idle.closed_within(100));
  EXPECT_ANY_THROW(RawClient{port});
}

}  // namespace
}  // namespace lightkiln::test
