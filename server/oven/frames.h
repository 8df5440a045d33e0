#pragma once

// What a worker and its oven say to each other: typed frames with a length, over a socket pair.
//
//   frame   = magic u32, type u32, length u64, payload of `length` bytes; little-endian
//   payload = numbers of 8 bytes and texts (length u64, bytes), in the order given beside each type
//
// The worker speaks first on each subject and the oven answers; while the oven works it sends
// `progress`, and any byte that reaches it then means "stop". Neither end trusts the other: every
// length is capped by its type before memory is taken, and every read of a payload is checked.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/descriptor.h"
#include "core/base/error.h"

namespace lightkiln {

enum class FrameType : uint32_t {
  hello = 1,     // oven: text per missing sandbox layer, preceded by their number
  input,         // worker: digest; carries the blob's descriptor
  load,          // worker: spec json, threads, memory bytes, chunk seconds; after all inputs
  loaded,        // oven: nothing
  plan,          // worker: nothing
  plan_result,   // oven: plan json, chunks, predicted seconds
  use_plan,      // worker: plan json; no answer
  chunk,         // worker: index
  chunk_result,  // oven: bytes, report json, elements, sum of squared errors
  stored_chunk,  // worker: bytes, report json; in order, no answer
  assemble,      // worker: nothing
  artifact,      // oven: name, role, media type, bytes
  result,        // oven: accuracy json; after all artifacts
  progress,      // oven: fraction
  error,         // oven: code name, sentence, pointer
};
inline constexpr uint32_t kLastFrameType = static_cast<uint32_t>(FrameType::error);

// The most bytes that a payload of this type may have.
uint64_t max_payload(FrameType type);

struct Frame {
  FrameType type = FrameType::hello;
  std::string payload;
  Descriptor descriptor;  // of `input`
};

class PayloadWriter {
 public:
  PayloadWriter& number(uint64_t value);
  PayloadWriter& real(double value);
  PayloadWriter& text(std::string_view value);
  PayloadWriter& bytes(std::span<const std::byte> value);
  std::string take() { return std::move(payload_); }

 private:
  std::string payload_;
};

// Throws Error{internal} when the payload ends early, or at end() when something is left.
class PayloadReader {
 public:
  explicit PayloadReader(std::string_view payload) : rest_(payload) {}
  uint64_t number();
  double real();
  std::string_view text();
  std::vector<std::byte> bytes();
  void end() const;

 private:
  std::string_view take(uint64_t size);
  std::string_view rest_;
};

std::string frame_header(FrameType type, uint64_t length);

// Cuts a stream into frames, however it was torn. Throws Error{internal} on a wrong magic number,
// an unknown type or a length over the cap; it takes memory only as bytes arrive.
class FrameParser {
 public:
  void feed(std::string_view bytes);
  std::optional<Frame> next();

 private:
  void begin_payload();
  std::string header_;
  std::optional<Frame> partial_;
  uint64_t missing_ = 0;
  std::deque<Frame> complete_;
};

// The other end of the pipe is gone.
class PeerGone : public Error {
 public:
  PeerGone() : Error(ErrorCode::unavailable, "The other end of the oven's pipe is gone.") {}
};

// One end of the socket pair. send() may be called from several threads; receive() from one.
class Channel {
 public:
  // `interrupted` is asked while waiting; once true, send and receive throw Error{cancelled}.
  explicit Channel(Descriptor socket, std::function<bool()> interrupted = {});

  // Throws PeerGone, Error{too_large}.
  void send(FrameType type, std::string_view payload, int descriptor = -1);
  // The next frame, or nothing after `wait_ms` (negative = for ever). Throws PeerGone at the end
  // of the stream.
  std::optional<Frame> receive(int wait_ms);
  // Whether bytes (or the end) wait to be read.
  bool readable() const;

 private:
  void send_piece(std::string_view bytes, int descriptor);
  bool wait_for(short events, int wait_ms) const;
  void read_some();

  Descriptor socket_;
  std::function<bool()> interrupted_;
  std::mutex send_mutex_;
  FrameParser parser_;
  std::deque<Descriptor> descriptors_;
};

}  // namespace lightkiln
