#include "server/http/gate.h"

#include <algorithm>

#include <arpa/inet.h>

#include "core/base/error.h"
#include "proto/json.h"

namespace lightkiln {

namespace {

constexpr int kFailuresAMinute = 10;
constexpr size_t kAddressesRemembered = 4096;
const std::pair<const char*, Scope> kScopes[] = {{"read", Scope::read},
                                                 {"submit", Scope::submit},
                                                 {"cancel", Scope::cancel},
                                                 {"metrics", Scope::metrics}};

// "name:port", "name", "[::1]:port" → the name, lower case, without brackets.
std::string host_name(std::string_view authority) {
  if (authority.starts_with('[')) {
    const size_t end = authority.find(']');
    if (end == std::string_view::npos) return "";
    const std::string_view rest = authority.substr(end + 1);
    if (!rest.empty() && rest.front() != ':') return "";
    authority = authority.substr(1, end - 1);
  } else {
    authority = authority.substr(0, authority.find(':'));
  }
  std::string name(authority);
  for (char& c : name)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return name;
}

// Takes the same time wherever the texts differ.
bool equal_in_constant_time(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  volatile unsigned result = difference;
  return result == 0;
}

std::vector<std::string> split(std::string_view text, std::string_view separators) {
  std::vector<std::string> parts;
  while (!text.empty()) {
    const size_t end = std::min(text.find_first_of(separators), text.size());
    if (end > 0) parts.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return parts;
}

std::vector<Scope> parse_scopes(const std::string& text, const std::string& where) {
  std::vector<Scope> scopes;
  for (const std::string& word : split(text, ",")) {
    bool known = word == "admin";
    for (const auto& [name, scope] : kScopes) {
      if (word != name && word != "admin") continue;
      scopes.push_back(scope);
      known = true;
    }
    if (!known)
      throw Error(
          ErrorCode::invalid_input,
          where + ": '" + word + "' is no scope; allowed: read, submit, cancel, metrics, admin.");
  }
  return scopes;
}

}  // namespace

std::vector<Token> parse_tokens(std::string_view text) {
  std::vector<Token> tokens;
  int number = 0;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::vector<std::string> words = split(text.substr(0, end), " \t\r");
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (words.empty() || words[0].starts_with('#')) continue;
    const std::string where = "Line " + std::to_string(number) + " of the token file";
    if (words.size() != 3)
      throw Error(ErrorCode::invalid_input, where + " must read: name sha256-hex scopes.");
    const std::string digest = "sha256:" + words[1];
    if (!is_digest(digest))
      throw Error(ErrorCode::invalid_input,
                  where + ": the second word must be 64 lower-case hexadecimal digits.");
    tokens.push_back({words[0], digest, parse_scopes(words[2], where)});
  }
  return tokens;
}

bool is_loopback(std::string_view host) {
  const std::string name = host_name(host == "::1" ? "[::1]" : host);
  if (name == "localhost" || name == "::1") return true;
  if (!name.starts_with("127.")) return false;
  return std::all_of(name.begin(), name.end(),
                     [](char c) { return (c >= '0' && c <= '9') || c == '.'; });
}

std::string allowed_host(const std::string& value) {
  const Error wrong(ErrorCode::invalid_spec,
                    "The host '" + value +
                        "' must be a name of letters, digits, '-', '_' and '.', or an address, "
                        "without a port.");
  std::string bare = value;
  const bool bracketed = bare.starts_with('[') && bare.ends_with(']');
  if (bracketed) bare = bare.substr(1, bare.size() - 2);
  if (bracketed || bare.find(':') != std::string::npos) {
    bare = bare.substr(0, bare.find('%'));  // a zone means something on this host alone
    in6_addr address{};
    if (::inet_pton(AF_INET6, bare.c_str(), &address) != 1) throw wrong;
    return host_name('[' + bare + ']');
  }
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  if (bare.empty() || bare.size() > 253 || !std::all_of(bare.begin(), bare.end(), plain))
    throw wrong;
  return host_name(bare);
}

namespace {

std::vector<std::string> allowed_hosts(std::vector<std::string> hosts) {
  for (std::string& host : hosts) host = allowed_host(host);
  return hosts;
}

}  // namespace

Gate::Gate(std::vector<std::string> hosts, std::vector<Token> tokens)
    : hosts_(allowed_hosts(std::move(hosts))), tokens_(std::move(tokens)) {}

std::optional<Gate::Refusal> Gate::check_host(const HttpHead& head) const {
  const std::string* host = head.header("host");
  const std::string name = host ? host_name(*host) : "";
  if (host && is_loopback(*host)) return std::nullopt;
  if (!name.empty() && std::find(hosts_.begin(), hosts_.end(), name) != hosts_.end())
    return std::nullopt;
  return Refusal{421, "The Host header names no host that this daemon serves."};
}

std::optional<Gate::Refusal> Gate::check_origin(const HttpHead& head) const {
  if (head.method == "GET" || head.method == "HEAD") return std::nullopt;
  const std::string* site = head.header("sec-fetch-site");
  const bool foreign_site = site && *site != "same-origin" && *site != "none";
  const std::string* origin = head.header("origin");
  const std::string* host = head.header("host");
  const bool foreign_origin =
      origin && (!host || (*origin != "http://" + *host && *origin != "https://" + *host));
  if (foreign_site || foreign_origin)
    return Refusal{403, "A page of another site may not change anything here."};
  return std::nullopt;
}

Gate::Refusal Gate::count_failure(const std::string& peer, std::string detail) {
  const auto now = std::chrono::steady_clock::now();
  if (failures_.size() >= kAddressesRemembered) failures_.clear();
  Failures& failures = failures_[peer];
  if (failures.count == 0 || now - failures.since > std::chrono::minutes(1)) failures = {now, 0};
  if (++failures.count > kFailuresAMinute)
    return {429, "Too many attempts without a valid token; try again in a minute."};
  return {401, std::move(detail)};
}

std::optional<Gate::Refusal> Gate::check_token(const HttpHead& head, Scope scope) {
  if (tokens_.empty() || scope == Scope::open) return std::nullopt;
  const std::string* header = head.header("authorization");
  // Asking without a token is how a client learns that it needs one: not an attempt.
  if (!header) return Refusal{401, "This request needs a token: Authorization: Bearer <token>."};
  if (!header->starts_with("Bearer ") || header->size() > 256)
    return count_failure(head.peer, "The Authorization header must be: Bearer <token>.");
  const std::string digest = sha256_digest(header->data() + 7, header->size() - 7);
  const Token* found = nullptr;
  for (const Token& token : tokens_)
    if (equal_in_constant_time(token.secret_digest, digest)) found = &token;
  if (!found) return count_failure(head.peer, "The token is not known.");
  if (std::find(found->scopes.begin(), found->scopes.end(), scope) == found->scopes.end())
    return Refusal{403, "The token does not carry the scope that this request needs."};
  return std::nullopt;
}

}  // namespace lightkiln
