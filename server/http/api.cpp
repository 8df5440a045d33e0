#include "server/http/api.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "proto/messages.h"
#include "server/http/problems.h"
#include "server/http/router.h"
#include "server/http/routes.h"

namespace lightkiln {

struct Api::Impl {
  Impl(Store& store, Log& log, ApiOptions given)
      : options(std::move(given)),
        gate(options.hosts, options.tokens),
        context{store, log, options, Waiters(options.max_waiters), {}} {
    for (const Route& route : routes) router.add(route.method, route.pattern);
  }

  const ApiOptions options;
  const std::vector<Route> routes = all_routes();
  Router router;
  Gate gate;
  RouteContext context;

  Admission admit(const HttpHead& head);
  HttpReply handle(IncomingRequest& request);
  void served(const ServedRequest& request);
  void log_failure(const HttpHead& head, std::string_view what);
};

namespace {

Admission refused(HttpReply reply) {
  Admission admission;
  admission.refusal = std::move(reply);
  return admission;
}

HttpReply no_such_route(const HttpHead& head, const std::vector<std::string>& allowed) {
  if (allowed.empty()) return status_reply(404, "There is nothing at this path.", head.request_id);
  std::string list;
  for (const std::string& method : allowed) list += (list.empty() ? "" : ", ") + method;
  HttpReply reply =
      status_reply(405, "This path takes " + list + ", not " + head.method + ".", head.request_id);
  return reply.set("Allow", list);
}

bool is_json(const HttpHead& head) {
  const std::string* type = head.header("content-type");
  if (!type) return false;
  std::string name = type->substr(0, type->find(';'));
  while (!name.empty() && name.back() == ' ') name.pop_back();
  for (char& c : name)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return name == "application/json";
}

const char* unknown_parameter(const HttpHead& head, const Route& route) {
  for (const auto& [name, value] : head.query) {
    const bool known = std::any_of(route.query.begin(), route.query.end(),
                                   [&](const char* allowed) { return name == allowed; });
    if (!known) return name.c_str();
  }
  return nullptr;
}

}  // namespace

Admission Api::Impl::admit(const HttpHead& head) {
  if (const auto refusal = gate.check_host(head))
    return refused(status_reply(refusal->status, refusal->detail, head.request_id));
  const Router::Match match = router.match(head.method, head.segments);
  if (match.route < 0) return refused(no_such_route(head, match.allowed));
  const Route& route = routes[static_cast<size_t>(match.route)];
  if (const auto refusal = gate.check_origin(head))
    return refused(status_reply(refusal->status, refusal->detail, head.request_id));
  if (const auto refusal = gate.check_token(head, route.scope)) {
    HttpReply reply = status_reply(refusal->status, refusal->detail, head.request_id);
    if (refusal->status == 401) reply.set("WWW-Authenticate", "Bearer");
    return refused(std::move(reply));
  }
  if (const char* name = unknown_parameter(head, route)) {
    std::string allowed;
    for (const char* one : route.query) allowed += std::string(allowed.empty() ? "" : ", ") + one;
    return refused(
        status_reply(400,
                     "The query parameter '" + std::string(name) + "' is not known; " +
                         (allowed.empty() ? "none is taken." : "allowed: " + allowed + "."),
                     head.request_id));
  }
  if (route.body == BodyRule::buffered && !is_json(head))
    return refused(
        status_reply(415, "Send the body as Content-Type: application/json.", head.request_id));
  Admission admission;
  admission.body = route.body;
  if (route.body == BodyRule::buffered) admission.body_limit = kMaxRequestBytes;
  if (route.body == BodyRule::streamed) admission.body_limit = options.max_blob_bytes;
  return admission;
}

HttpReply Api::Impl::handle(IncomingRequest& request) {
  const HttpHead& head = request.head;
  Router::Match match = router.match(head.method, head.segments);
  RouteCall call{request, std::move(match.values)};
  try {
    return routes[static_cast<size_t>(match.route)].handle(context, call);
  } catch (const HttpRefusal& refusal) {
    return status_reply(refusal.status, refusal.detail, head.request_id);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::internal) log_failure(head, error.what());
    return error_reply(error, head.request_id);
  } catch (const std::exception& error) {
    log_failure(head, error.what());
  } catch (...) {
    log_failure(head, "something that is no exception was thrown");
  }
  return error_reply(Error(ErrorCode::internal, ""), head.request_id);
}

void Api::Impl::log_failure(const HttpHead& head, std::string_view what) {
  context.log.write(LogLevel::error, "failure",
                    {{"request_id", std::string_view(head.request_id)}, {"detail", what}});
}

// Reads are frequent and say little: they are logged only on demand, or when they fail.
void Api::Impl::served(const ServedRequest& request) {
  const HttpHead& head = request.head;
  context.counts.count(head.method, request.status, request.seconds);
  LogLevel level = LogLevel::info;
  if (request.status >= 500) level = LogLevel::warning;
  if (request.status < 400 && (head.method == "GET" || head.method == "HEAD"))
    level = LogLevel::debug;
  if (!context.log.enabled(level)) return;
  context.log.write(level, "request",
                    {{"request_id", std::string_view(head.request_id)},
                     {"method", std::string_view(head.method)},
                     {"path", std::string_view(head.path)},
                     {"status", static_cast<int64_t>(request.status)},
                     {"bytes", static_cast<int64_t>(request.reply_bytes)},
                     {"ms", request.seconds * 1000},
                     {"peer", std::string_view(head.peer)}});
}

Api::Api(Store& store, Log& log, ApiOptions options)
    : impl_(std::make_unique<Impl>(store, log, std::move(options))) {}

Api::~Api() = default;

HttpApplication Api::application() {
  return {[this](const HttpHead& head) { return impl_->admit(head); },
          [this](IncomingRequest& request) { return impl_->handle(request); },
          [this](const ServedRequest& request) { impl_->served(request); }};
}

void Api::stop_waiting() {
  impl_->context.waiters.stop();
}

std::vector<RouteInfo> Api::routes() const {
  std::vector<RouteInfo> result;
  for (const Route& route : impl_->routes)
    result.push_back({route.method, route.pattern, route.scope});
  return result;
}

}  // namespace lightkiln
