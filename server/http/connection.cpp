#include "server/http/connection.h"

#include <algorithm>
#include <cerrno>

#include <poll.h>
#include <sys/sendfile.h>
#include <sys/socket.h>
#include <unistd.h>
namespace lightkiln {

std::shared_ptr<const int> own_descriptor(int descriptor) {
  return std::shared_ptr<const int>(new int(descriptor), [](const int* held) {
    ::close(*held);
    delete held;
  });
}

Connection::~Connection() {
  ::close(fd);
}

bool too_slow(Clock::time_point start, Clock::time_point now, uint64_t bytes, int64_t grace_ms,
              uint64_t least_bytes_per_s) {
  const int64_t late_ms = ms_since(start, now) - grace_ms;
  if (late_ms <= 0) return false;
  return bytes < static_cast<uint64_t>(late_ms) * least_bytes_per_s / 1000 + 1;
}

namespace {

bool would_block() {
  return errno == EAGAIN || errno == EWOULDBLOCK;
}

// One turn sends a bounded part of a file, so that a fast reader does not hold up the others.
constexpr size_t kFileTurnBytes = 512 * 1024;

}  // namespace

SendResult send_reply(Connection& c) {
  while (c.out_sent < c.out.size()) {
    const int more = c.file && c.file->length > 0 ? MSG_MORE : 0;
    const ssize_t sent = ::send(c.fd, c.out.data() + c.out_sent, c.out.size() - c.out_sent,
                                MSG_NOSIGNAL | MSG_DONTWAIT | more);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return would_block() ? SendResult::again : SendResult::broken;
    c.out_sent += static_cast<size_t>(sent);
    c.phase_bytes += static_cast<uint64_t>(sent);
    c.last_progress = Clock::now();
  }
  size_t turn = 0;
  while (c.file && c.file->length > 0) {
    if (turn >= kFileTurnBytes) return SendResult::again;
    off_t offset = static_cast<off_t>(c.file->offset);
    const size_t want = std::min<uint64_t>(c.file->length, kFileTurnBytes);
    const ssize_t sent = ::sendfile(c.fd, *c.file->descriptor, &offset, want);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return would_block() ? SendResult::again : SendResult::broken;
    if (sent == 0) return SendResult::broken;  // the file became shorter than was promised
    turn += static_cast<size_t>(sent);
    c.file->offset += static_cast<uint64_t>(sent);
    c.file->length -= static_cast<uint64_t>(sent);
    c.phase_bytes += static_cast<uint64_t>(sent);
    c.last_progress = Clock::now();
  }
  return SendResult::done;
}

SocketBody::SocketBody(Connection& connection, int64_t grace_ms, uint64_t least_bytes_per_s,
                       int64_t stall_ms)
    : connection_(connection),
      grace_ms_(grace_ms),
      least_bytes_per_s_(least_bytes_per_s),
      stall_ms_(stall_ms),
      left_(connection.request.head.content_length) {}

size_t SocketBody::read(char* data, size_t size) {
  size = std::min<uint64_t>(size, left_);
  if (size == 0) return 0;
  size_t got = std::min(size, connection_.in.size());
  if (got > 0) {
    std::copy_n(connection_.in.data(), got, data);
    connection_.in.erase(0, got);
  }
  Clock::time_point last = Clock::now();
  while (got == 0) {
    const ssize_t received = ::recv(connection_.fd, data, size, MSG_DONTWAIT);
    if (received > 0) {
      got = static_cast<size_t>(received);
      break;
    }
    if (received == 0 || (errno != EINTR && !would_block()))
      throw HttpRefusal{400, "The connection closed before the whole body arrived."};
    const auto now = Clock::now();
    if (too_slow(start_, now, got_, grace_ms_, least_bytes_per_s_) ||
        ms_since(last, now) > stall_ms_)
      throw HttpRefusal{408, "The body arrived too slowly."};
    pollfd waited{connection_.fd, POLLIN, 0};
    ::poll(&waited, 1, 250);
  }
  got_ += got;
  left_ -= got;
  return got;
}

}  // namespace lightkiln
