// The fence's small parts by themselves: ranges, router, gate, log.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/error.h"
#include "proto/json.h"
#include "server/http/gate.h"
#include "server/http/log.h"
#include "server/http/ranges.h"
#include "server/http/router.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

std::string describe(std::string_view range, uint64_t size) {
  const ByteRange parsed = parse_range(range, size);
  if (parsed.kind == RangeKind::whole) return "whole";
  if (parsed.kind == RangeKind::unsatisfiable) return "unsatisfiable";
  return std::to_string(parsed.first) + '-' + std::to_string(parsed.last);
}

TEST(Ranges, AreClampedToTheRepresentation) {
  EXPECT_EQ(describe("bytes=0-0", 1000), "0-0");
  EXPECT_EQ(describe("bytes=900-5000", 1000), "900-999");
  EXPECT_EQ(describe("bytes=900-", 1000), "900-999");
  EXPECT_EQ(describe("bytes=-1", 1000), "999-999");
  EXPECT_EQ(describe("bytes=-5000", 1000), "0-999");
  EXPECT_EQ(describe("bytes=1000-", 1000), "unsatisfiable");
  EXPECT_EQ(describe("bytes=5000-", 1000), "unsatisfiable");
  EXPECT_EQ(describe("bytes=-0", 1000), "unsatisfiable");
  EXPECT_EQ(describe("bytes=0-", 0), "unsatisfiable");
  EXPECT_EQ(describe("bytes=0-18446744073709551616", 10), "0-9");
  EXPECT_EQ(describe("bytes=18446744073709551615-", 10), "unsatisfiable");
}

TEST(Ranges, ThatMakeNoSenseAreIgnored) {
  for (const char* text : {"", "bytes", "bytes=", "bytes=-", "bytes=a-b", "bytes=5-2", "lines=0-1",
                           "bytes=0x1-2", "bytes=1--2", "0-1"})
    EXPECT_EQ(describe(text, 1000), "whole") << text;
}

TEST(Router, MatchesBySegmentsAndNamesOtherMethods) {
  Router router;
  router.add("GET", "/v1/jobs/{id}");
  router.add("DELETE", "/v1/jobs/{id}");
  router.add("POST", "/v1/jobs/{id}:cancel");
  router.add("PUT", "/v1/blobs/{digest}");
  router.add("GET", "/");
  const auto match = [&](const char* method, std::vector<std::string> segments) {
    return router.match(method, segments);
  };
  EXPECT_EQ(match("GET", {"v1", "jobs", "a"}).route, 0);
  EXPECT_EQ(match("HEAD", {"v1", "jobs", "a"}).route, 0);
  EXPECT_EQ(match("GET", {"v1", "jobs", "a"}).values, std::vector<std::string>{"a"});
  EXPECT_EQ(match("POST", {"v1", "jobs", "a:cancel"}).route, 2);
  EXPECT_EQ(match("POST", {"v1", "jobs", "a:cancel"}).values, std::vector<std::string>{"a"});
  EXPECT_EQ(match("POST", {"v1", "jobs", ":cancel"}).route, -1);
  EXPECT_EQ(match("PUT", {"v1", "blobs", "sha256:00"}).values[0], "sha256:00");
  EXPECT_EQ(match("GET", {}).route, 4);
  EXPECT_EQ(match("GET", {"v1", "jobs", ""}).route, -1);
  EXPECT_TRUE(match("GET", {"v1", "jobs", "a", ""}).allowed.empty());
  EXPECT_EQ(match("PUT", {"v1", "jobs", "a"}).allowed,
            (std::vector<std::string>{"GET", "DELETE", "HEAD"}));
  EXPECT_EQ(match("GET", {"v1", "jobs", "a:cancel"}).allowed, std::vector<std::string>{"POST"});
}

HttpHead head_with(std::vector<std::pair<std::string, std::string>> headers,
                   const char* method = "POST") {
  HttpHead head;
  head.method = method;
  head.headers = std::move(headers);
  head.peer = "127.0.0.1";
  return head;
}

TEST(Gate, LetsInOnlyKnownHostNames) {
  const Gate gate({"bake.studio"}, {});
  for (const char* host : {"localhost", "localhost:7420", "127.0.0.1", "127.0.0.1:80", "[::1]",
                           "[::1]:7420", "LOCALHOST", "bake.studio", "bake.studio:443"})
    EXPECT_FALSE(gate.check_host(head_with({{"host", host}}))) << host;
  for (const char* host :
       {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example",
        "bake.studio.evil.example", "0.0.0.0", "[::1", "[::1]x", "evil:127.0.0.1"})
    EXPECT_TRUE(gate.check_host(head_with({{"host", host}}))) << host;
}

TEST(Gate, TakesAllowedHostsInAnySpelling) {
  const Gate gate({"Farm.Local", "[FE80::1]", "2001:db8::2", "fe80::3%eth0", "render_node"}, {});
  for (const char* host : {"farm.local", "FARM.local:7420", "[fe80::1]", "[FE80::1]:80",
                           "[2001:db8::2]:80", "[fe80::3]", "render_node:1"})
    EXPECT_FALSE(gate.check_host(head_with({{"host", host}}))) << host;
  for (const char* host : {"farm.local:7420", "http://farm.local", "farm local", "farm/local", "",
                           "[farm.local]", "[::1]:80", "10.0.0.1:80", "f\xc3\xa4rm"})
    EXPECT_THROW(Gate({host}, {}), Error) << host;
}

TEST(Gate, LetsNoOtherSiteChangeAnything) {
  const Gate gate({}, {});
  const auto passes = [&](std::vector<std::pair<std::string, std::string>> headers,
                          const char* method = "POST") {
    headers.emplace_back("host", "localhost:7420");
    return !gate.check_origin(head_with(std::move(headers), method));
  };
  EXPECT_TRUE(passes({}));
  EXPECT_TRUE(passes({{"origin", "http://localhost:7420"}}));
  EXPECT_TRUE(passes({{"origin", "https://localhost:7420"}}));
  EXPECT_FALSE(passes({{"origin", "http://localhost:3000"}}));
  EXPECT_FALSE(passes({{"origin", "http://evil.example"}}));
  EXPECT_FALSE(passes({{"origin", "null"}}));
  EXPECT_FALSE(passes({{"sec-fetch-site", "cross-site"}}));
  EXPECT_FALSE(passes({{"sec-fetch-site", "same-site"}}));
  EXPECT_TRUE(passes({{"sec-fetch-site", "same-origin"}}));
  EXPECT_FALSE(passes({{"origin", "http://evil.example"}}, "DELETE"));
  EXPECT_FALSE(passes({{"origin", "http://evil.example"}}, "PUT"));
  EXPECT_TRUE(passes({{"origin", "http://evil.example"}}, "GET")) << "reads carry no CORS headers";
}

std::vector<Token> two_tokens() {
  const std::string reader = sha256_digest("reader-secret", 13).substr(7);
  const std::string admin = sha256_digest("admin-secret", 12).substr(7);
  return parse_tokens("# tokens\nreader " + reader + " read,metrics\r\n\nboss\t" + admin +
                      " admin\n");
}

TEST(Gate, HoldsTokensToTheirScopes) {
  Gate gate({}, two_tokens());
  const auto status = [&](const char* authorization, Scope scope) {
    HttpHead head = head_with({});
    if (authorization) head.headers.emplace_back("authorization", authorization);
    const auto refusal = gate.check_token(head, scope);
    return refusal ? refusal->status : 200;
  };
  for (const Scope scope : {Scope::read, Scope::submit, Scope::cancel, Scope::metrics}) {
    const bool readers = scope == Scope::read || scope == Scope::metrics;
    EXPECT_EQ(status(nullptr, scope), 401);
    EXPECT_EQ(status("Bearer reader-secret", scope), readers ? 200 : 403);
    EXPECT_EQ(status("Bearer admin-secret", scope), 200);
  }
  EXPECT_EQ(status(nullptr, Scope::open), 200);
  EXPECT_EQ(status("Bearer reader-secret ", Scope::read), 401);
  EXPECT_EQ(status("Basic reader-secret", Scope::read), 401);
  EXPECT_EQ(status("Bearer ", Scope::read), 401);
}

TEST(Gate, SlowsDownGuessingWithoutShuttingOutTheHonest) {
  Gate gate({}, two_tokens());
  HttpHead guess = head_with({{"authorization", "Bearer guess"}});
  for (int i = 0; i < 10; ++i) EXPECT_EQ(gate.check_token(guess, Scope::read)->status, 401);
  EXPECT_EQ(gate.check_token(guess, Scope::read)->status, 429);
  EXPECT_FALSE(
      gate.check_token(head_with({{"authorization", "Bearer admin-secret"}}), Scope::read));
  guess.peer = "10.0.0.1";
  EXPECT_EQ(gate.check_token(guess, Scope::read)->status, 401);
}

TEST(Gate, RefusesTokenFilesThatAreWrong) {
  const std::string digest(64, 'a');
  EXPECT_EQ(parse_tokens("a " + digest + " read\n").size(), 1u);
  for (const std::string& text :
       {std::string("a secret read"), "a " + digest, "a " + digest + " write",
        "a " + std::string(64, 'A') + " read", "a " + digest + " read extra"})
    EXPECT_THROW(parse_tokens(text), Error) << text;
}

TEST(Log, ClientsCannotForgeLines) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path() / "log";
  const int fd = ::open(path.c_str(), O_CREAT | O_WRONLY, 0600);
  Log log(LogLevel::info, fd);
  const std::string nasty =
      std::string("a\"\\\n{\"level\":\"error\"}\x7f\xff") + std::string(500, 'x');
  log.write(LogLevel::info, "request", {{"path", std::string_view(nasty)}});
  log.write(LogLevel::debug, "not shown");
  ::close(fd);
  const auto bytes = test::read_file(path);
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_NE(text.find("\\u000a{\\\"level\\\""), std::string::npos) << text;
  EXPECT_LT(text.size(), 500u);
}

}  // namespace
}  // namespace lightkiln
