#include "server/http/loop.h"

#include <algorithm>
#include <cerrno>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/base/error.h"
#include "server/http/problems.h"
#include "server/http/request_id.h"

namespace lightkiln {

namespace {

constexpr int kSweepMs = 200;
// Refused connections that may be told why at one time; more are closed without a word.
constexpr int kRefusalPlaces = 64;

std::string numeric_address(const sockaddr_storage& address) {
  char text[INET6_ADDRSTRLEN] = "";
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    inet_ntop(AF_INET, &v4.sin_addr, text, sizeof text);
  } else if (address.ss_family == AF_INET6) {
    const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
    inet_ntop(AF_INET6, &v6.sin6_addr, text, sizeof text);
  }
  return text;
}

}  // namespace

Loop::Loop(const FenceLimits& limits, const HttpApplication& application, Wire& wire)
    : limits_(limits),
      application_(application),
      wire_(wire),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (epoll_ < 0 || wake_ < 0)
    throw Error(ErrorCode::unavailable, "The process may open no more descriptors.");
}

Loop::~Loop() {
  stop(0);
  ::close(epoll_);
  ::close(wake_);
}

void Loop::start() {
  ::fcntl(wire_.socket(), F_SETFL, ::fcntl(wire_.socket(), F_GETFL) | O_NONBLOCK);
  ::fcntl(wire_.socket(), F_SETFD, FD_CLOEXEC);
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = wake_;
  ::epoll_ctl(epoll_, EPOLL_CTL_ADD, wake_, &event);
  event.data.fd = wire_.socket();
  ::epoll_ctl(epoll_, EPOLL_CTL_ADD, wire_.socket(), &event);
  accepting_ = listener_armed_ = true;
  pool_ = std::make_unique<Pool>(limits_.threads, limits_.queue);
  thread_ = std::thread([this] { run(); });
}

void Loop::stop(int64_t drain_ms) {
  if (!thread_.joinable()) return;
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    deadline_ = Clock::now() + std::chrono::milliseconds(drain_ms);
  }
  const uint64_t one = 1;
  (void)!::write(wake_, &one, sizeof one);
  thread_.join();
  // Whoever still reads an upload is told that no more will come.
  for (const auto& [fd, c] : connections_) ::shutdown(fd, SHUT_RDWR);
  pool_.reset();  // joins handlers that are still at work
  connections_.clear();
}

void Loop::run() {
  std::vector<epoll_event> events(256);
  for (;;) {
    int timeout = connections_.empty() && listener_armed_ && accepting_ ? -1 : kSweepMs;
    if (!pipelined_.empty()) timeout = 0;
    const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), timeout);
    for (int i = 0; i < count; ++i) {
      const int fd = events[static_cast<size_t>(i)].data.fd;
      if (fd == wake_) continue;
      if (accepting_ && fd == wire_.socket()) {
        accept_all();
        continue;
      }
      const auto found = connections_.find(fd);
      if (found != connections_.end()) on_event(*found->second);
    }
    take_finished();
    take_pipelined();
    const auto now = Clock::now();
    if (ms_since(last_sweep_, now) >= kSweepMs || !accepting_) sweep();
    if (accepting_) continue;
    if (connections_.empty() || now >= drain_until_) return;
  }
}

void Loop::accept_all() {
  for (;;) {
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    const int fd = ::accept4(wire_.socket(), reinterpret_cast<sockaddr*>(&from), &size,
                             SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
      if (errno == EINTR || errno == ECONNABORTED) continue;
      if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
        // No descriptor left: let go of the listener until the next sweep instead of spinning.
        epoll_event none{};
        none.data.fd = wire_.socket();
        ::epoll_ctl(epoll_, EPOLL_CTL_MOD, wire_.socket(), &none);
        listener_armed_ = false;
      }
      return;
    }
    const int on = 1;
    ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    const std::string address = numeric_address(from);
    const bool room = make_room(address);
    if (!room && static_cast<int>(connections_.size()) >= limits_.connections + kRefusalPlaces) {
      ::close(fd);
      continue;
    }
    auto& c = *(connections_[fd] = std::make_unique<Connection>(fd, address));
    ++per_address_[address];
    epoll_event event{};
    event.events = EPOLLONESHOT;
    event.data.fd = fd;
    ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event);
    if (!room) {
      refuse(c, 503, "Too many connections are open; try again shortly.");
      continue;
    }
    // Most clients have sent their request by the time they are accepted.
    receive(c);
  }
}

// Closes the connection that has the least to lose when a limit is reached: one that only drains,
// then the one idle longest, then the oldest that has not finished its head. False when none such
// is there.
bool Loop::make_room(const std::string& address) {
  const auto mine = per_address_.find(address);
  const bool address_full =
      mine != per_address_.end() && mine->second >= limits_.connections_per_address;
  if (!address_full && static_cast<int>(connections_.size()) < limits_.connections) return true;
  Connection* victim = nullptr;
  const auto rank = [](const Connection& c) {
    if (c.phase == Phase::draining) return 3;
    if (c.phase == Phase::head && c.in.empty()) return 2;
    return c.phase == Phase::head ? 1 : 0;
  };
  for (const auto& [fd, c] : connections_) {
    if (rank(*c) == 0 || (address_full && c->peer != address)) continue;
    if (!victim || rank(*c) > rank(*victim) ||
        (rank(*c) == rank(*victim) && c->phase_start < victim->phase_start))
      victim = c.get();
  }
  if (victim) close(*victim);
  return victim != nullptr;
}

void Loop::on_event(Connection& c) {
  switch (c.phase) {
    case Phase::head:
    case Phase::body:
      receive(c);
      break;
    case Phase::writing:
      send(c);
      break;
    case Phase::draining:
      drain(c);
      break;
    case Phase::working:
      break;
  }
}

void Loop::take_finished() {
  uint64_t count = 0;
  (void)!::read(wake_, &count, sizeof count);
  std::vector<Connection*> finished;
  bool stopping = false;
  {
    std::lock_guard lock(mutex_);
    finished.swap(finished_);
    stopping = stopping_;
    drain_until_ = deadline_;
  }
  for (Connection* c : finished) {
    give_upload_place_back(*c);
    c->enter(Phase::writing);
    send(*c);
  }
  if (stopping && accepting_) {
    accepting_ = false;
    ::epoll_ctl(epoll_, EPOLL_CTL_DEL, wire_.socket(), nullptr);
    wire_.close_socket();
  }
}

void Loop::sweep() {
  const auto now = last_sweep_ = Clock::now();
  if (!listener_armed_ && accepting_) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = wire_.socket();
    listener_armed_ = ::epoll_ctl(epoll_, EPOLL_CTL_MOD, wire_.socket(), &event) == 0;
  }
  std::vector<Connection*> all;
  all.reserve(connections_.size());
  for (const auto& [fd, c] : connections_) all.push_back(c.get());
  for (Connection* c : all) sweep_one(*c, now);
}

void Loop::sweep_one(Connection& c, Clock::time_point now) {
  if (c.phase == Phase::working) return;  // not ours
  const int64_t age = ms_since(c.phase_start, now);
  const bool slow =
      too_slow(c.phase_start, now, c.phase_bytes, limits_.grace_ms, limits_.least_bytes_per_s) ||
      ms_since(c.last_progress, now) > limits_.stall_ms;
  switch (c.phase) {
    case Phase::head:
      if (!c.in.empty()) {
        if (age > limits_.head_ms) refuse(c, 408, "The request head took too long to arrive.");
      } else if (age > (c.served > 0 ? limits_.idle_ms : limits_.head_ms) || !accepting_) {
        close(c);
      }
      break;
    case Phase::body:
      if (slow) refuse(c, 408, "The body arrived too slowly.");
      break;
    case Phase::writing:
      if (slow) close(c);
      break;
    case Phase::draining:
      if (age > limits_.drain_ms) close(c);
      break;
    case Phase::working:
      break;
  }
}

}  // namespace lightkiln
