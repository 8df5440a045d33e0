#pragma once

// The HTTP fence: everything that reaches a route has passed it, and everything that leaves, also.
//
// One thread watches every socket: it reads heads and small bodies under limits of size, time and
// rate, and sends replies, so that a slow peer never holds anything but its own socket. Complete
// requests go to a bounded pool of threads. Large uploads are read by a pool thread, a few at a
// time; files are sent by the watching thread.
//
// cpp-httplib 0.11.4 gives the listening socket and writes replies. It never reads a peer's bytes:
// its own reader has no total deadline, smuggles requests through bodies that it did not read,
// inflates bodies past its limits, applies ranges beyond the end of a body, and holds a thread for
// every connection.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "server/http/head.h"
#include "server/http/http.h"

namespace lightkiln {

struct FenceLimits {
  HeadLimits head;
  int64_t head_ms = 5000;                   // from the first byte (or accept) to the end of a head
  int64_t idle_ms = 30000;                  // of a kept connection between requests
  int64_t grace_ms = 5000;                  // before a least rate is asked of a body or a reader
  uint64_t least_bytes_per_s = 16 * 1024;   // after that, on average
  int64_t stall_ms = 10000;                 // without one byte of a reply taken or an upload sent
  int64_t drain_ms = 2000;                  // given to a refused peer to finish talking
  uint64_t buffered_body_bytes = 1u << 20;  // above: only streamed, with a pool thread
  uint64_t buffered_bytes_total = 64u << 20;  // of all bodies being buffered; above: 503
  int requests_per_connection = 1000;
  int connections = 256;
  int connections_per_address = 32;
  int backlog = 1024;
  int threads = 48;
  size_t queue = 256;  // requests waiting for a thread; above: 503
  int uploads = 8;     // streamed at a time; above: 503
  // Of one address once half of all places are taken, so that no slow sender shuts others out.
  int uploads_per_address = 2;
};

class Fence {
 public:
  Fence(const FenceLimits& limits, HttpApplication application);
  ~Fence();  // stop(0)
  Fence(const Fence&) = delete;
  Fence& operator=(const Fence&) = delete;

  // Listens on a numeric or resolvable host; port 0 takes a free one. Gives the port. Throws
  // Error{unavailable} when the address cannot be bound.
  int listen(const std::string& host, int port);
  // Stops accepting, lets requests in hand finish for up to `drain_ms`, then closes everything.
  void stop(int64_t drain_ms);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lightkiln
