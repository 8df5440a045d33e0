#pragma once

// One accepted socket and where it stands. A connection belongs to the watching thread in every
// phase but `working`, when it belongs to the pool thread that holds it; hand-over goes through
// locked queues, so no field needs a lock of its own.

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/http/http.h"

namespace lightkiln {

using Clock = std::chrono::steady_clock;

inline int64_t ms_since(Clock::time_point start, Clock::time_point now) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(now - start).count();
}

enum class Phase {
  head,      // waiting for a request head, or reading it
  body,      // buffering a body
  working,   // a pool thread has it
  writing,   // sending a reply
  draining,  // reply sent, reading on so that the peer gets to see it
};

struct Connection {
  Connection(int socket, std::string address) : fd(socket), peer(std::move(address)) {}
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const int fd;
  const std::string peer;
  Phase phase = Phase::head;
  Clock::time_point phase_start = Clock::now();
  Clock::time_point last_progress = phase_start;
  uint64_t phase_bytes = 0;  // moved in this phase
  int served = 0;            // replies sent
  bool armed_for_write = false;

  std::string in;           // received, not yet used
  IncomingRequest request;  // the one in hand
  uint64_t reserved = 0;    // of the budget for buffered bodies
  bool streaming = false;   // holds one of the upload places
  Clock::time_point request_start;

  int status = 0;   // of the reply in hand
  std::string out;  // head, and body unless it is a file
  size_t out_sent = 0;
  std::optional<FileBody> file;
  uint64_t reply_bytes = 0;
  bool close_after = false;  // no further request on this connection
  bool unread_body = false;  // the peer may still be sending what nobody will read

  void enter(Phase next) {
    phase = next;
    phase_start = last_progress = Clock::now();
    phase_bytes = 0;
  }
};

enum class SendResult { done, again, broken };
// Sends as much as the socket takes of `out`, then of `file`. Never blocks.
SendResult send_reply(Connection& connection);

// Reads the body of an upload from a connection that this thread owns: first what came with the
// head, then from the socket, under the same rules of rate and stall as buffered bodies.
class SocketBody : public BodyReader {
 public:
  SocketBody(Connection& connection, int64_t grace_ms, uint64_t least_bytes_per_s,
             int64_t stall_ms);
  size_t read(char* data, size_t size) override;
  uint64_t left() const { return left_; }

 private:
  Connection& connection_;
  const int64_t grace_ms_;
  const uint64_t least_bytes_per_s_;
  const int64_t stall_ms_;
  const Clock::time_point start_ = Clock::now();
  uint64_t left_;
  uint64_t got_ = 0;
};

// Whether `bytes` in the time since `start` is slower than the least rate allows.
bool too_slow(Clock::time_point start, Clock::time_point now, uint64_t bytes, int64_t grace_ms,
              uint64_t least_bytes_per_s);

}  // namespace lightkiln
