#include "server/http/head.h"

#include <string>

#include <gtest/gtest.h>
#include <rapidcheck.h>

namespace lightkiln {
namespace {

constexpr HeadLimits kLimits;

// The status that a head is refused with; 0 = accepted.
int verdict(const std::string& bytes, HttpHead* out = nullptr) {
  const HeadScan scan = scan_head(bytes, kLimits);
  if (scan.fault) return scan.fault->status;
  if (scan.length == 0) return -1;
  HttpHead head;
  const auto fault = parse_head(std::string_view(bytes).substr(0, scan.length), kLimits, head);
  if (out) *out = head;
  return fault ? fault->status : 0;
}
std::string with(const std::string& headers, const std::string& method = "GET") {
  return method + " /livez HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

TEST(Head, TakesAnOrdinaryRequest) {
  HttpHead head;
  ASSERT_EQ(verdict("GET /v1/jobs/a%20b?text=x+y&after= HTTP/1.1\r\nHost: localhost:7420\r\n"
                    "If-None-Match:\t\"a\" \r\n\r\n",
                    &head),
            0);
  EXPECT_EQ(head.method, "GET");
  EXPECT_EQ(head.segments, (std::vector<std::string>{"v1", "jobs", "a b"}));
  ASSERT_NE(head.parameter("text"), nullptr);
  EXPECT_EQ(*head.parameter("text"), "x y");
  EXPECT_EQ(*head.parameter("after"), "");
  EXPECT_EQ(head.parameter("none"), nullptr);
  EXPECT_EQ(*head.header("if-none-match"), "\"a\"");
  EXPECT_FALSE(head.close);
}

TEST(Head, ClosesWhenAskedOrWhenHttpIsOld) {
  HttpHead head;
  ASSERT_EQ(verdict(with("Connection: Close\r\n"), &head), 0);
  EXPECT_TRUE(head.close);
  ASSERT_EQ(verdict("GET / HTTP/1.0\r\nHost: localhost\r\n\r\n", &head), 0);
  EXPECT_TRUE(head.close);
}

TEST(Head, RefusesAmbiguousFraming) {
  EXPECT_EQ(verdict(with("Content-Length: 3\r\n", "POST")), 0);
  EXPECT_EQ(verdict(with("Content-Length: 3\r\n")), 400) << "a GET has no body";
  EXPECT_EQ(verdict(with("Content-Length: 0\r\n")), 0);
  EXPECT_EQ(verdict(with("Content_Length: 3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("transfer_encoding: chunked\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("X_Custom_Length: 3\r\n", "POST")), 0);
  EXPECT_EQ(verdict(with("Content-Length: 3\r\nContent-Length: 3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length: 3, 3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length: abc\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length: +3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length: -3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length:\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Content-Length: 999999999999999\r\n", "POST")), 0);
  EXPECT_EQ(verdict(with("Content-Length: 1000000000000000\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("Transfer-Encoding: chunked\r\n", "POST")), 411);
  EXPECT_EQ(verdict(with("Transfer-Encoding: gzip, chunked\r\n", "POST")), 411);
  EXPECT_EQ(verdict(with("Transfer-Encoding: chunked\r\n", "DELETE")), 411);
  EXPECT_EQ(verdict(with("Transfer-Encoding: chunked\r\nContent-Length: 3\r\n", "POST")), 400);
  EXPECT_EQ(verdict(with("transfer-encoding : chunked\r\n", "POST")), 400);
}

TEST(Head, RefusesWhatServersHaveReadInTwoWays) {
  EXPECT_EQ(verdict("GET /livez HTTP/1.1\r\n\r\n"), 400) << "no Host";
  EXPECT_EQ(verdict(with("Host: evil\r\n")), 400) << "two Hosts";
  EXPECT_EQ(verdict("GET /livez HTTP/1.1\nHost: localhost\n\n"), 400) << "bare LF";
  EXPECT_EQ(verdict("GET /livez HTTP/1.1\r\nHost: localhost\nX: 1\r\n\r\n"), 400);
  EXPECT_EQ(verdict(with("X: 1\r\n folded\r\n")), 400);
  EXPECT_EQ(verdict(with("X : 1\r\n")), 400);
  EXPECT_EQ(verdict(with(": 1\r\n")), 400);
  EXPECT_EQ(verdict(with("no colon\r\n")), 400);
  EXPECT_EQ(verdict(with(std::string("X: a\0b\r\n", 8))), 400);
  EXPECT_EQ(verdict(with("X: a\rb\r\n")), 400);
  EXPECT_EQ(verdict(with("REMOTE_ADDR: 10.0.0.1\r\n")), 400);
  EXPECT_EQ(verdict(with("Remote-Addr: 10.0.0.1\r\n")), 400);
  EXPECT_EQ(verdict(with("LOCAL_PORT: 1\r\n")), 400);
  EXPECT_EQ(verdict("\r\n" + with("")), 400);
}

TEST(Head, RefusesWhatItDoesNotDoWithTheRightStatus) {
  EXPECT_EQ(verdict(with("Content-Encoding: gzip\r\n", "POST")), 415);
  EXPECT_EQ(verdict(with("Content-Type: Multipart/Form-Data; boundary=x\r\n", "POST")), 415);
  EXPECT_EQ(verdict(with("Range: bytes=0-,0-\r\n")), 416);
  EXPECT_EQ(verdict(with("Range: bytes=" + std::string(60, '0') + "-\r\n")), 416);
  EXPECT_EQ(verdict(with("Range: bytes=0-\r\n")), 0);
  EXPECT_EQ(verdict(with("Expect: 100-continue\r\n", "POST")), 0);
  EXPECT_EQ(verdict(with("Expect: tea\r\n")), 417);
  EXPECT_EQ(verdict("GET / HTTP/2.0\r\nHost: localhost\r\n\r\n"), 505);
  EXPECT_EQ(verdict("GET /\r\nHost: localhost\r\n\r\n"), 400);
}

TEST(Head, RefusesPathsThatMeanMoreThanTheySay) {
  const auto path = [](const std::string& target) {
    return verdict("GET " + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  };
  EXPECT_EQ(path("/a/b"), 0);
  EXPECT_EQ(path("/%2e%2e/etc"), 400);
  EXPECT_EQ(path("/../etc"), 400);
  EXPECT_EQ(path("/..%2fetc"), 400);
  EXPECT_EQ(path("/a%5cb"), 400);
  EXPECT_EQ(path("/a%00b"), 400);
  EXPECT_EQ(path("/a%0db"), 400);
  EXPECT_EQ(path("/a%"), 400);
  EXPECT_EQ(path("/a%2"), 400);
  EXPECT_EQ(path("/a%zz"), 400);
  EXPECT_EQ(path("/%ff"), 400) << "not UTF-8";
  EXPECT_EQ(path("/%c3%a9"), 0);
  EXPECT_EQ(path("/a?b=%00"), 400);
  EXPECT_EQ(path("/a#b"), 400);
  EXPECT_EQ(path("http://localhost/a"), 400);
  EXPECT_EQ(path("*"), 400);
}

TEST(Head, EndsAtItsLimitsAndNotBefore) {
  const auto line = [](size_t bytes) {
    return "GET /" + std::string(bytes - 14, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
  };
  EXPECT_EQ(verdict(line(1024)), 0);
  EXPECT_EQ(verdict(line(1025)), 414);
  EXPECT_EQ(verdict(line(8192)), 414);
  EXPECT_EQ(verdict("GET /" + std::string(2000, 'a')), 414) << "before its end has come";

  const auto lines = [](size_t count) {
    std::string text = "GET / HTTP/1.1\r\nHost: localhost\r\n";
    for (size_t i = 2; i < count; ++i) text += "X: 1\r\n";
    return text + "\r\n";
  };
  EXPECT_EQ(verdict(lines(64)), 0);
  EXPECT_EQ(verdict(lines(65)), 431);

  const auto bytes = [](size_t count) {
    const std::string before = "GET / HTTP/1.1\r\nHost: localhost\r\nX: ";
    return before + std::string(count - before.size() - 4, 'a') + "\r\n\r\n";
  };
  EXPECT_EQ(verdict(bytes(16 * 1024)), 0);
  EXPECT_EQ(verdict(bytes(16 * 1024 + 1)), 431);
}

TEST(Head, AsksForMoreUntilTheHeadIsWhole) {
  const std::string whole = with("X: 1\r\n");
  for (size_t size = 0; size < whole.size(); ++size)
    EXPECT_EQ(verdict(whole.substr(0, size)), -1) << size;
  EXPECT_EQ(scan_head(whole + "GET / HTTP/1.1\r\n", kLimits).length, whole.size());
}

TEST(Head, AnyBytesGiveAVerdict) {
  rc::check("scan and parse end on arbitrary bytes", [](const std::string& bytes) {
    verdict(bytes);
    verdict("GET /" + bytes + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
    verdict(with(bytes + "\r\n"));
    decode_percent(bytes);
  });
}

TEST(Head, KnowsUtf8) {
  EXPECT_TRUE(is_utf8("plain \xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80"));
  EXPECT_FALSE(is_utf8("\xc0\xaf")) << "overlong";
  EXPECT_FALSE(is_utf8("\xe0\x80\xaf")) << "overlong";
  EXPECT_FALSE(is_utf8("\xed\xa0\x80")) << "surrogate";
  EXPECT_FALSE(is_utf8("\xf4\x90\x80\x80")) << "beyond U+10FFFF";
  EXPECT_FALSE(is_utf8("\xe2\x82")) << "cut off";
}

}  // namespace
}  // namespace lightkiln
