// The daemon itself: health, version, metrics, documentation and the dashboard's files.

#include <algorithm>
#include <cstdio>
#include <string_view>

#include <unistd.h>

#include "proto/messages.h"
#include "server/http/assets.h"
#include "server/http/problems.h"
#include "server/http/ranges.h"
#include "server/http/routes.h"

namespace lightkiln {

namespace {

constexpr const char* kPagePolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

HttpReply text_reply(std::string text, const char* media_type = "text/plain; charset=utf-8") {
  HttpReply reply;
  reply.media_type = media_type;
  reply.body = std::move(text);
  reply.set("Cache-Control", "no-store");
  return reply;
}

HttpReply page_headers(HttpReply reply) {
  return reply.set("Content-Security-Policy", kPagePolicy)
      .set("Referrer-Policy", "no-referrer")
      .set("Cross-Origin-Opener-Policy", "same-origin")
      .set("Cross-Origin-Resource-Policy", "same-origin");
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

HttpReply live(RouteContext&, RouteCall&) {
  return text_reply("ok\n");
}

HttpReply ready(RouteContext& context, RouteCall& call) {
  const StoreHealth health = context.store.health();
  std::string lines, wrong;
  const auto check = [&](const char* name, bool good, const std::string& detail) {
    lines += std::string(good ? "[+] " : "[-] ") + name + (good ? " ok" : ": " + detail) + '\n';
    if (!good) wrong += (wrong.empty() ? "" : " ") + detail;
  };
  check("store", health.writable,
        health.detail.empty() ? "The store cannot be written." : health.detail);
  check("leases", health.overdue == 0,
        std::to_string(health.overdue) + " tasks are overdue and no worker rescues them.");
  if (!wrong.empty()) return status_reply(503, wrong, call.request.head.request_id);
  if (!call.request.head.parameter("verbose")) return text_reply("ok\n");
  lines += "free_bytes " + std::to_string(health.free_bytes) + "\nqueued " +
           std::to_string(health.queued) + "\nrunning " + std::to_string(health.running) + '\n';
  const std::vector<WorkerRecord> workers = context.store.workers();
  lines += "workers " + std::to_string(workers.size()) + '\n';
  for (const WorkerRecord& worker : workers)
    if (!worker.missing_layers.empty())
      lines += "[!] sandbox: the ovens of worker " + worker.name + " lack " +
               joined(worker.missing_layers) + ", as its operator allows\n";
  return text_reply(lines);
}

HttpReply version(RouteContext&, RouteCall&) {
  return json_reply(write_version({}));
}
HttpReply workers(RouteContext& context, RouteCall&) {
  std::vector<WorkerMessage> messages;
  for (const WorkerRecord& worker : context.store.workers())
    messages.push_back({worker.name, worker.missing_layers});
  return json_reply(write_workers(messages));
}
HttpReply kinds(RouteContext&, RouteCall&) {
  return json_reply(write_kinds());
}

uint64_t resident_bytes() {
  uint64_t pages = 0;
  if (FILE* file = std::fopen("/proc/self/statm", "re")) {
    unsigned long long all = 0, resident = 0;
    if (std::fscanf(file, "%llu %llu", &all, &resident) == 2) pages = resident;
    std::fclose(file);
  }
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

// The Prometheus text format, version 0.0.4.
HttpReply metrics(RouteContext& context, RouteCall&) {
  std::string text = "# TYPE lightkiln_jobs gauge\n", totals;
  for (const auto& [name, count] : context.store.counts()) {
    const size_t slash = name.find('/');
    const std::string value = ' ' + std::to_string(count) + '\n';
    if (slash != std::string::npos)
      text += "lightkiln_jobs{kind=\"" + name.substr(0, slash) + "\",state=\"" +
              name.substr(slash + 1) + "\"}" + value;
    else
      totals += "# TYPE lightkiln_" + name + (name.ends_with("_total") ? " counter" : " gauge") +
                "\nlightkiln_" + name + value;
  }
  std::map<std::string, int> missing_layers;
  const std::vector<WorkerRecord> workers = context.store.workers();
  for (const WorkerRecord& worker : workers)
    for (const std::string& layer : worker.missing_layers) ++missing_layers[layer];
  totals += "# TYPE lightkiln_workers_without_sandbox_layer gauge\n";
  for (const auto& [layer, count] : missing_layers)
    totals += "lightkiln_workers_without_sandbox_layer{layer=\"" + layer + "\"} " +
              std::to_string(count) + '\n';
  const StoreHealth health = context.store.health();
  const auto gauge = [&](const char* name, uint64_t value) {
    totals += std::string("# TYPE lightkiln_") + name + " gauge\nlightkiln_" + name + ' ' +
              std::to_string(value) + '\n';
  };
  gauge("store_writable", health.writable ? 1 : 0);
  gauge("store_free_bytes", health.free_bytes);
  gauge("jobs_queued", health.queued);
  gauge("jobs_running", health.running);
  gauge("leases_overdue", health.overdue);
  gauge("workers", workers.size());
  gauge("resident_memory_bytes", resident_bytes());
  const auto up = std::chrono::steady_clock::now() - context.started;
  gauge("uptime_seconds",
        static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::seconds>(up).count()));
  text += totals;
  text += "# TYPE lightkiln_build_info gauge\nlightkiln_build_info{version=\"" +
          std::string(LIGHTKILN_VERSION) + "\"} 1\n";
  context.counts.write(text);
  return text_reply(std::move(text), "text/plain; version=0.0.4; charset=utf-8");
}

HttpReply asset_reply(const HttpHead& head, const Asset& asset) {
  const std::string digest = sha256_digest(asset.data, asset.size);
  const std::string etag = '"' + digest + '"';
  if (none_match_hits(head, etag)) return not_modified(etag);
  HttpReply reply;
  reply.media_type = asset.media_type;
  reply.body.assign(reinterpret_cast<const char*>(asset.data), asset.size);
  reply.set("ETag", etag).set("Cache-Control", "no-cache");
  return page_headers(std::move(reply));
}

HttpReply file_at(RouteCall& call, const std::string& path) {
  const Asset* asset = find_asset(assets(), path.c_str());
  if (!asset) throw Error(ErrorCode::not_found, "There is nothing at this path.");
  return asset_reply(call.request.head, *asset);
}

HttpReply openapi(RouteContext&, RouteCall& call) {
  return file_at(call, "/openapi.json");
}
HttpReply front_page(RouteContext&, RouteCall& call) {
  return file_at(call, "/index.html");
}
HttpReply page_file(RouteContext&, RouteCall& call) {
  return file_at(call, '/' + call.values[0]);
}

std::string escape_html(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '&')
      result += "&amp;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

HttpReply explain_problem(RouteContext&, RouteCall& call) {
  const ProblemKind* kind = find_problem_kind(call.values[0]);
  if (!kind) throw Error(ErrorCode::not_found, "There is no problem of this name.");
  const std::string title = escape_html(kind->title);
  const char* again =
      kind->retryable ? "The same request may succeed later." : "The same request will fail again.";
  return page_headers(
      text_reply("<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>" + title +
                     "</title>\n<h1>" + title + "</h1>\n<p>Code <code>" + escape_html(kind->code) +
                     "</code>, HTTP status " + std::to_string(kind->status) + ".</p>\n<p>" +
                     escape_html(kind->meaning) + "</p>\n<p>" + again + "</p>\n</html>\n",
                 "text/html; charset=utf-8"));
}

}  // namespace

const Asset* find_asset(std::span<const Asset> all, const char* path) {
  for (const Asset& asset : all)
    if (std::string_view(asset.path) == path) return &asset;
  return nullptr;
}

// Methods are named one by one: a client may send any token, and each would become a series.
void RequestCounts::count(const std::string& method, int status, double seconds) {
  static constexpr std::string_view kMethods[] = {"GET", "HEAD", "POST", "PUT", "DELETE"};
  const bool known =
      std::find(std::begin(kMethods), std::end(kMethods), method) != std::end(kMethods);
  std::lock_guard lock(mutex_);
  ++requests_[{known ? method : "other", status}];
  seconds_ += seconds;
}

void RequestCounts::write(std::string& text) const {
  std::lock_guard lock(mutex_);
  text += "# TYPE lightkiln_http_requests_total counter\n";
  for (const auto& [key, count] : requests_)
    text += "lightkiln_http_requests_total{method=\"" + key.first + "\",status=\"" +
            std::to_string(key.second) + "\"} " + std::to_string(count) + '\n';
  text += "# TYPE lightkiln_http_seconds_total counter\nlightkiln_http_seconds_total " +
          std::to_string(seconds_) + '\n';
}

std::vector<Route> service_routes() {
  const BodyRule none = BodyRule::none;
  return {
      {"GET", "/v1/kinds", Scope::read, none, {}, kinds},
      {"GET", "/v1/workers", Scope::read, none, {}, workers},
      {"GET", "/livez", Scope::open, none, {}, live},
      {"GET", "/readyz", Scope::open, none, {"verbose"}, ready},
      {"GET", "/version", Scope::open, none, {}, version},
      {"GET", "/metrics", Scope::metrics, none, {}, metrics},
      {"GET", "/openapi.json", Scope::open, none, {}, openapi},
      {"GET", "/problems/{slug}", Scope::open, none, {}, explain_problem},
      // The dashboard: not part of the API's description.
      {"GET", "/", Scope::open, none, {}, front_page},
      {"GET", "/{file}", Scope::open, none, {}, page_file},
  };
}

}  // namespace lightkiln
