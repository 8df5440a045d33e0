#pragma once

// Who may call what: names of this host, same-origin rules, and tokens with scopes.
//
// A name that resolves to loopback can be anybody's (DNS rebinding), so only known Host names pass.
// A page of another site can make a browser send requests, so a request that changes something must
// come from our own pages or from no page at all.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/http/http.h"

namespace lightkiln {

enum class Scope { open, read, submit, cancel, metrics };

// A bearer token by the SHA-256 of its secret; the secret itself is stored nowhere.
struct Token {
  std::string name;
  std::string secret_digest;  // "sha256:<hex>"
  std::vector<Scope> scopes;
};

// Reads lines of `name sha256-hex scope[,scope…]`; scopes are read, submit, cancel, metrics and
// admin (all of them). Empty lines and lines that begin with '#' are skipped. Throws
// Error{invalid_input} with the line's number.
std::vector<Token> parse_tokens(std::string_view text);

// A literal address that only this host can reach.
bool is_loopback(std::string_view host);

// A name or an address as Host gives it, in lower case and without brackets. Throws
// Error{invalid_spec} for a value with a port, or with a byte that no host name has.
std::string allowed_host(const std::string& value);

class Gate {
 public:
  // `hosts`: names allowed in Host besides loopback ones, as allowed_host() takes them. No tokens:
  // every scope is open to whoever reaches the socket.
  Gate(std::vector<std::string> hosts, std::vector<Token> tokens);

  struct Refusal {
    int status = 403;
    std::string detail;
  };
  std::optional<Refusal> check_host(const HttpHead& head) const;
  // For methods that change something; GET and HEAD always pass.
  std::optional<Refusal> check_origin(const HttpHead& head) const;
  // Not thread-safe: bad tokens are counted by address, and after ten in a minute they are answered
  // with 429. A good token always passes.
  std::optional<Refusal> check_token(const HttpHead& head, Scope scope);

 private:
  const std::vector<std::string> hosts_;
  const std::vector<Token> tokens_;
  struct Failures {
    std::chrono::steady_clock::time_point since;
    int count = 0;
  };
  std::map<std::string, Failures> failures_;
  Refusal count_failure(const std::string& peer, std::string detail);
};

}  // namespace lightkiln
