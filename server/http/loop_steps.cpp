// The way of one request through the loop: receive, advance, dispatch, reply, and on to the next.

#include <algorithm>
#include <cerrno>
#include <exception>

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/base/error.h"
#include "server/http/loop.h"
#include "server/http/problems.h"
#include "server/http/request_id.h"

namespace lightkiln {

namespace {

// Bytes taken from a socket in one turn.
constexpr size_t kReceiveBytes = 64 * 1024;
// Bytes read and thrown away after a refusal, so that the peer sees the reply before a reset.
constexpr uint64_t kDrainBytes = 32u << 20;

// A client's own id is kept when it is short and plain.
std::string request_id_of(const HttpHead& head) {
  const std::string* given = head.header("x-request-id");
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  if (given && !given->empty() && given->size() <= 64 &&
      std::all_of(given->begin(), given->end(), plain))
    return *given;
  return make_request_id();
}

}  // namespace

void Loop::arm(Connection& c, bool for_write) {
  epoll_event event{};
  event.events = (for_write ? EPOLLOUT : EPOLLIN) | EPOLLONESHOT;
  event.data.fd = c.fd;
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, c.fd, &event);
}

void Loop::close(Connection& c) {
  reserved_ -= c.reserved;
  const auto count = per_address_.find(c.peer);
  if (count != per_address_.end() && --count->second == 0) per_address_.erase(count);
  connections_.erase(c.fd);
}

void Loop::receive(Connection& c) {
  thread_local std::string buffer(kReceiveBytes, '\0');
  for (;;) {
    size_t want = kReceiveBytes;
    if (c.phase == Phase::head) want = limits_.head.bytes;
    if (c.phase == Phase::body)
      want = std::min<uint64_t>(want, c.request.head.content_length - c.request.body.size());
    const ssize_t got = ::recv(c.fd, buffer.data(), want, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return arm(c, false);
    if (got <= 0) return close(c);
    const auto size = static_cast<size_t>(got);
    c.phase_bytes += size;
    c.last_progress = Clock::now();
    if (c.phase == Phase::body) {
      c.request.body.append(buffer.data(), size);
      if (c.request.body.size() < c.request.head.content_length) continue;
      return dispatch(c);
    }
    if (c.in.empty()) c.phase_start = c.last_progress;
    c.in.append(buffer.data(), size);
    return advance(c);
  }
}

// In phase `head` with some bytes.
void Loop::advance(Connection& c) {
  const HeadScan scan = scan_head(c.in, limits_.head);
  if (scan.fault) {
    c.unread_body = true;
    return refuse(c, scan.fault->status, scan.fault->detail);
  }
  if (scan.length == 0) return arm(c, false);
  begin_request(c, scan.length);
}

void Loop::begin_request(Connection& c, size_t head_bytes) {
  c.request = IncomingRequest();
  c.request_start = Clock::now();
  HttpHead& head = c.request.head;
  const auto fault = parse_head(std::string_view(c.in).substr(0, head_bytes), limits_.head, head);
  c.in.erase(0, head_bytes);
  head.peer = c.peer;
  head.request_id = request_id_of(head);
  c.unread_body = fault.has_value() || head.content_length > 0;
  if (fault) return refuse(c, fault->status, fault->detail);
  Admission admission;
  try {
    admission = application_.admit(head);
  } catch (const std::exception&) {
    return refuse(c, 500, "");
  }
  if (admission.refusal) return reply(c, *admission.refusal, c.unread_body);
  begin_body(c, admission);
}

bool Loop::take_upload_place(Connection& c) {
  const auto mine = uploads_per_address_.find(c.peer);
  const bool many =
      mine != uploads_per_address_.end() && mine->second >= limits_.uploads_per_address;
  if (uploads_ >= limits_.uploads || (many && 2 * uploads_ >= limits_.uploads)) return false;
  ++uploads_;
  ++uploads_per_address_[c.peer];
  c.streaming = true;
  return true;
}

void Loop::give_upload_place_back(Connection& c) {
  if (!c.streaming) return;
  c.streaming = false;
  --uploads_;
  const auto mine = uploads_per_address_.find(c.peer);
  if (--mine->second == 0) uploads_per_address_.erase(mine);
}

void Loop::begin_body(Connection& c, const Admission& admission) {
  const uint64_t length = c.request.head.content_length;
  if (length > 0 && admission.body == BodyRule::none)
    return refuse(c, 413, "This request takes no body.");
  if (length > admission.body_limit)
    return refuse(c, 413,
                  "The body may be at most " + std::to_string(admission.body_limit) +
                      " bytes long; Content-Length says " + std::to_string(length) + ".");
  const bool streamed =
      admission.body == BodyRule::streamed && length > limits_.buffered_body_bytes;
  if (streamed && !take_upload_place(c))
    return refuse(c, 503, "Too many uploads are under way; try again shortly.");
  if (!streamed && reserved_ + length > limits_.buffered_bytes_total)
    return refuse(c, 503, "Too many request bodies are under way; try again shortly.");
  if (length > 0 && c.request.head.expects_continue && c.in.empty()) {
    static constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
    ::send(c.fd, kContinue.data(), kContinue.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  if (streamed) return dispatch(c);
  reserved_ += length;
  c.reserved = length;
  const size_t ready = std::min<uint64_t>(length, c.in.size());
  c.request.body.assign(c.in, 0, ready);
  c.in.erase(0, ready);
  if (c.request.body.size() == length) return dispatch(c);
  c.enter(Phase::body);
  c.phase_bytes = ready;
  receive(c);
}

void Loop::dispatch(Connection& c) {
  if (!c.streaming) c.unread_body = false;
  c.enter(Phase::working);
  if (pool_->try_push([this, &c] { work(c); })) return;
  give_upload_place_back(c);
  refuse(c, 503, "The server is overloaded; try again shortly.");
}

// On a pool thread, which owns the connection until it is handed back.
void Loop::work(Connection& c) {
  SocketBody body(c, limits_.grace_ms, limits_.least_bytes_per_s, limits_.stall_ms);
  if (c.streaming) c.request.reader = &body;
  HttpReply answer;
  try {
    answer = application_.handle(c.request);
  } catch (const HttpRefusal& refusal) {
    answer = status_reply(refusal.status, refusal.detail, c.request.head.request_id);
  } catch (const Error& error) {
    answer = error_reply(error, c.request.head.request_id);
  } catch (const std::exception&) {
    answer = status_reply(500, "", c.request.head.request_id);
  } catch (...) {
    answer = status_reply(500, "", c.request.head.request_id);
  }
  c.request.reader = nullptr;
  if (c.streaming) c.unread_body = body.left() > 0;
  render(c, answer, c.unread_body);
  send_reply(c);  // most replies fit into the socket; the loop sends the rest
  bool first = false;
  {
    std::lock_guard lock(mutex_);
    first = finished_.empty();
    finished_.push_back(&c);
  }
  const uint64_t one = 1;
  if (first) (void)!::write(wake_, &one, sizeof one);
}

void Loop::render(Connection& c, const HttpReply& answer, bool close) {
  c.close_after = close || c.request.head.close || c.served + 1 >= limits_.requests_per_connection;
  HttpReply full = answer;
  full.set("X-Request-Id", c.request.head.request_id).set("X-Content-Type-Options", "nosniff");
  c.out = wire_.render(c.request.head, full, c.close_after);
  c.out_sent = 0;
  c.file.reset();
  if (answer.file && c.request.head.method != "HEAD") c.file = answer.file;
  c.status = answer.status;
  c.reply_bytes = c.out.size() + (c.file ? c.file->length : 0);
}

void Loop::reply(Connection& c, const HttpReply& answer, bool close) {
  render(c, answer, close);
  c.enter(Phase::writing);
  send(c);
}

// Answers with a problem and ends the connection: what follows on it cannot be trusted or waited
// for.
void Loop::refuse(Connection& c, int status, const std::string& detail) {
  if (c.request.head.request_id.empty()) c.request.head.request_id = make_request_id();
  c.request.head.peer = c.peer;
  reply(c, status_reply(status, detail, c.request.head.request_id), true);
}

void Loop::send(Connection& c) {
  switch (send_reply(c)) {
    case SendResult::done:
      return finish_reply(c);
    case SendResult::again:
      return arm(c, true);
    case SendResult::broken:
      return close(c);
  }
}

void Loop::finish_reply(Connection& c) {
  const std::chrono::duration<double> spent = Clock::now() - c.request_start;
  if (application_.served)
    application_.served({c.request.head, c.status, c.reply_bytes, spent.count()});
  ++c.served;
  reserved_ -= c.reserved;
  c.reserved = 0;
  c.file.reset();
  c.out.clear();
  if (c.close_after || !accepting_) {
    ::shutdown(c.fd, SHUT_WR);
    if (!c.unread_body && c.in.empty()) return close(c);
    c.enter(Phase::draining);
    return drain(c);
  }
  c.request = IncomingRequest();
  c.enter(Phase::head);
  // Not at once: a long pipeline would nest as deep as it is long.
  if (!c.in.empty()) return pipelined_.push_back(c.fd);
  arm(c, false);
}

void Loop::take_pipelined() {
  std::vector<int> ready;
  ready.swap(pipelined_);
  for (const int fd : ready) {
    const auto found = connections_.find(fd);
    if (found == connections_.end()) continue;
    Connection& c = *found->second;
    if (c.phase == Phase::head && !c.in.empty()) advance(c);
  }
}

void Loop::drain(Connection& c) {
  thread_local std::string buffer(kReceiveBytes, '\0');
  while (c.phase_bytes < kDrainBytes) {
    const ssize_t got = ::recv(c.fd, buffer.data(), buffer.size(), 0);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return arm(c, false);
    if (got <= 0) break;
    c.phase_bytes += static_cast<uint64_t>(got);
  }
  close(c);
}

}  // namespace lightkiln
