// Who may call what, over a socket; and the route table against the API's description.

#include <algorithm>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "tests/http/raw_client.h"
#include "tests/http/service.h"

namespace lightkiln::test {
namespace {

ApiOptions with_tokens() {
  ApiOptions options;
  const auto token = [](const std::string& name) {
    return name + ' ' + sha256_digest(name.data(), name.size()).substr(7) + ' ' + name + '\n';
  };
  // Each token's secret, name and scope are the same word.
  options.tokens = parse_tokens(token("read") + token("submit") + token("cancel") +
                                token("metrics") + token("admin"));
  options.hosts = {"bake.studio"};
  return options;
}

const char* scope_word(Scope scope) {
  switch (scope) {
    case Scope::open:
      return "";
    case Scope::read:
      return "read";
    case Scope::submit:
      return "submit";
    case Scope::cancel:
      return "cancel";
    case Scope::metrics:
      return "metrics";
  }
  return "";
}

// A path of the pattern: every parameter is "x".
std::string example_path(const std::string& pattern) {
  std::string path;
  bool inside = false;
  for (const char c : pattern) {
    if (c == '{') path += 'x';
    inside = c == '{' || (inside && c != '}');
    if (!inside && c != '}') path += c;
  }
  return path;
}

TEST(Access, EveryRouteAsksForItsScope) {
  Service service(Service::roomy(), with_tokens());
  for (const RouteInfo& route : service.api.routes()) {
    const std::string target = example_path(route.pattern);
    const auto status = [&](const std::string& token) {
      return request(service.port, route.method, target, "",
                     token.empty() ? "" : "Authorization: Bearer " + token + "\r\n")
          .status;
    };
    const std::string needed = scope_word(route.scope);
    const auto refused = [](int code) { return code == 401 || code == 403; };
    if (needed.empty()) {
      EXPECT_FALSE(refused(status(""))) << route.method << route.pattern;
      continue;
    }
    EXPECT_EQ(status(""), 401) << route.method << route.pattern;
    for (const std::string token : {"read", "submit", "cancel", "metrics"})
      EXPECT_EQ(status(token), token == needed ? status("admin") : 403)
          << token << ' ' << route.method << route.pattern;
    EXPECT_FALSE(refused(status("admin"))) << route.method << route.pattern;
  }
  const RawReply reply = get(service.port, "/v1/jobs");
  EXPECT_EQ(reply.header("www-authenticate"), "Bearer");
  EXPECT_EQ(get(service.port, "/v1/jobs?token=read").status, 401) << "never in a URL";
}

TEST(Access, ATokenThatIsWrongIsNeverEchoed) {
  Service service(Service::roomy(), with_tokens());
  for (int i = 0; i < 12; ++i) {
    const RawReply reply =
        get(service.port, "/v1/jobs", "Authorization: Bearer hunter2-secret\r\n");
    EXPECT_EQ(reply.status, i < 10 ? 401 : 429);
    EXPECT_EQ(reply.body.find("hunter2"), std::string::npos);
  }
  EXPECT_EQ(get(service.port, "/v1/jobs", "Authorization: Bearer read\r\n").status, 200);
}

TEST(Access, HostAndOriginAreHeldToThisHost) {
  Service service(Service::roomy(), with_tokens());
  struct Case {
    const char* host;
    const char* origin;
    int get_status, post_status;
  };
  // A POST without a body to :validate is refused with 415 once it is let in.
  const Case cases[] = {
      {"localhost", "", 200, 415},
      {"localhost:1234", "", 200, 415},
      {"127.0.0.1", "http://127.0.0.1", 200, 415},
      {"[::1]:7420", "http://[::1]:7420", 200, 415},
      {"bake.studio", "https://bake.studio", 200, 415},
      {"localhost", "http://evil.example", 200, 403},
      {"localhost", "null", 200, 403},
      {"localhost:7420", "http://localhost:7421", 200, 403},
      {"localhost", "http://localhost.evil.example", 200, 403},
      {"evil.example", "", 421, 421},
      {"evil.example", "http://evil.example", 421, 421},
      {"127.0.0.1.nip.io", "", 421, 421},
      {"169.254.169.254", "", 421, 421},
  };
  for (const Case& one : cases) {
    for (const bool reading : {true, false}) {
      RawClient client(service.port);
      std::string text = reading ? "GET /v1/jobs" : "POST /v1/jobs:validate";
      text += std::string(" HTTP/1.1\r\nAuthorization: Bearer admin\r\nHost: ") + one.host + "\r\n";
      if (*one.origin) text += std::string("Origin: ") + one.origin + "\r\n";
      client.send(text + "\r\n");
      const RawReply reply = client.receive();
      EXPECT_EQ(reply.status, reading ? one.get_status : one.post_status)
          << one.host << ' ' << one.origin << ' ' << reading;
      EXPECT_EQ(reply.header("access-control-allow-origin"), "");
    }
  }
}

// --- the table and the description, both ways
// -----------------------------------------------------

// Operations of openapi.json as "METHOD /path". The file is indented by two spaces a level: a path
// is a key of the third level, a method one of the fourth.
std::set<std::string> described_operations() {
  const auto bytes = read_file(std::string(LIGHTKILN_SOURCE_DIR) + "/proto/openapi.json");
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::set<std::string> operations;
  std::string path;
  size_t start = text.find("\n  \"paths\": {");
  const size_t end = text.find("\n  },", start);
  while ((start = text.find('\n', start + 1)) < end) {
    const std::string line = text.substr(start + 1, text.find('\n', start + 1) - start - 1);
    if (line.starts_with("    \"/")) path = line.substr(5, line.find('"', 5) - 5);
    for (const char* method : {"get", "head", "put", "post", "delete", "patch"}) {
      if (!line.starts_with("      \"" + std::string(method) + "\":")) continue;
      std::string upper = method;
      for (char& c : upper) c = static_cast<char>(std::toupper(c));
      operations.insert(upper + ' ' + path);
    }
  }
  return operations;
}

TEST(Access, TheRouteTableIsWhatTheDescriptionSays) {
  Service service;
  std::set<std::string> routes;
  for (const RouteInfo& route : service.api.routes()) {
    const bool page = route.pattern == "/" || route.pattern == "/{file}";
    if (!page) routes.insert(route.method + ' ' + route.pattern);
  }
  EXPECT_GT(routes.size(), 20u);
  EXPECT_EQ(routes, described_operations());
}

}  // namespace
}  // namespace lightkiln::test
