#include "server/oven/frames.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>

#include <poll.h>
#include <sys/socket.h>

namespace lightkiln {

static_assert(std::endian::native == std::endian::little);

namespace {

constexpr uint32_t kMagic = 0x4e454b4c;  // "LKEN"
constexpr size_t kHeaderBytes = 16;
constexpr uint64_t kGibibyte = 1ull << 30;
constexpr uint64_t kMebibyte = 1ull << 20;
constexpr size_t kReadBytes = 256u << 10;
constexpr size_t kMaxWaitingDescriptors = 16;
constexpr int kPollMs = 50;

[[noreturn]] void malformed(const char* what) {
  throw Error(ErrorCode::internal,
              std::string("Worker and oven misunderstood each other: ") + what + ".");
}

template <typename T>
void append_raw(std::string& out, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  out.append(raw, sizeof value);
}
template <typename T>
T read_raw(std::string_view bytes) {
  T value{};
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

}  // namespace

uint64_t max_payload(FrameType type) {
  switch (type) {
    case FrameType::artifact:
    case FrameType::chunk_result:
    case FrameType::stored_chunk:
      return 2 * kGibibyte;
    case FrameType::load:
    case FrameType::plan_result:
    case FrameType::use_plan:
    case FrameType::result:
      return 64 * kMebibyte;
    default:
      return 64u << 10;
  }
}

PayloadWriter& PayloadWriter::number(uint64_t value) {
  append_raw(payload_, value);
  return *this;
}
PayloadWriter& PayloadWriter::real(double value) {
  append_raw(payload_, value);
  return *this;
}
PayloadWriter& PayloadWriter::text(std::string_view value) {
  number(value.size());
  payload_.append(value);
  return *this;
}
PayloadWriter& PayloadWriter::bytes(std::span<const std::byte> value) {
  return text({reinterpret_cast<const char*>(value.data()), value.size()});
}

std::string_view PayloadReader::take(uint64_t size) {
  if (size > rest_.size()) malformed("a frame ends early");
  const std::string_view taken = rest_.substr(0, size);
  rest_.remove_prefix(size);
  return taken;
}
uint64_t PayloadReader::number() {
  return read_raw<uint64_t>(take(sizeof(uint64_t)));
}
double PayloadReader::real() {
  return read_raw<double>(take(sizeof(double)));
}
std::string_view PayloadReader::text() {
  return take(number());
}
std::vector<std::byte> PayloadReader::bytes() {
  const std::string_view taken = text();
  const auto* data = reinterpret_cast<const std::byte*>(taken.data());
  return {data, data + taken.size()};
}
void PayloadReader::end() const {
  if (!rest_.empty()) malformed("a frame is too long");
}

std::string frame_header(FrameType type, uint64_t length) {
  std::string header;
  append_raw(header, kMagic);
  append_raw(header, static_cast<uint32_t>(type));
  append_raw(header, length);
  return header;
}

void FrameParser::begin_payload() {
  const auto type = read_raw<uint32_t>(std::string_view(header_).substr(4));
  const auto length = read_raw<uint64_t>(std::string_view(header_).substr(8));
  if (read_raw<uint32_t>(header_) != kMagic) malformed("a frame begins wrongly");
  if (type < 1 || type > kLastFrameType) malformed("a frame of an unknown type");
  if (length > max_payload(static_cast<FrameType>(type))) malformed("a frame over its size limit");
  partial_.emplace();
  partial_->type = static_cast<FrameType>(type);
  missing_ = length;
  header_.clear();
}

void FrameParser::feed(std::string_view bytes) {
  while (!bytes.empty() || (partial_ && missing_ == 0)) {
    if (!partial_) {
      const size_t size = std::min(bytes.size(), kHeaderBytes - header_.size());
      header_.append(bytes.substr(0, size));
      bytes.remove_prefix(size);
      if (header_.size() == kHeaderBytes) begin_payload();
      continue;
    }
    const size_t size = std::min<uint64_t>(bytes.size(), missing_);
    partial_->payload.append(bytes.substr(0, size));
    bytes.remove_prefix(size);
    missing_ -= size;
    if (missing_ == 0) {
      complete_.push_back(std::move(*partial_));
      partial_.reset();
    }
  }
}

std::optional<Frame> FrameParser::next() {
  if (complete_.empty()) return std::nullopt;
  Frame frame = std::move(complete_.front());
  complete_.pop_front();
  return frame;
}

Channel::Channel(Descriptor socket, std::function<bool()> interrupted)
    : socket_(std::move(socket)), interrupted_(std::move(interrupted)) {}

bool Channel::wait_for(short events, int wait_ms) const {
  pollfd waiting{socket_.get(), events, 0};
  return poll(&waiting, 1, wait_ms) > 0;
}

bool Channel::readable() const {
  return wait_for(POLLIN, 0);
}

void Channel::send_piece(std::string_view bytes, int descriptor) {
  while (!bytes.empty()) {
    if (interrupted_ && interrupted_()) throw Error(ErrorCode::cancelled, "The work was given up.");
    iovec piece{const_cast<char*>(bytes.data()), bytes.size()};
    msghdr message{};
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
    if (descriptor >= 0) {
      message.msg_control = control;
      message.msg_controllen = sizeof control;
      cmsghdr* head = CMSG_FIRSTHDR(&message);
      head->cmsg_level = SOL_SOCKET;
      head->cmsg_type = SCM_RIGHTS;
      head->cmsg_len = CMSG_LEN(sizeof(int));
      std::memcpy(CMSG_DATA(head), &descriptor, sizeof descriptor);
    }
    const ssize_t sent = sendmsg(socket_.get(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) {
      bytes.remove_prefix(static_cast<size_t>(sent));
      descriptor = -1;  // travels with the first byte
    } else if (errno == EAGAIN) {
      wait_for(POLLOUT, kPollMs);
    } else if (errno != EINTR) {
      throw PeerGone();
    }
  }
}

void Channel::send(FrameType type, std::string_view payload, int descriptor) {
  const std::lock_guard lock(send_mutex_);
  if (payload.size() > max_payload(type))
    throw Error(ErrorCode::too_large, "A result of " + std::to_string(payload.size()) +
                                          " bytes is over the limit of " +
                                          std::to_string(max_payload(type)) + " bytes.");
  send_piece(frame_header(type, payload.size()), descriptor);
  send_piece(payload, -1);
}

void Channel::read_some() {
  std::string buffer(kReadBytes, '\0');
  iovec piece{buffer.data(), buffer.size()};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t got = recvmsg(socket_.get(), &message, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
  for (cmsghdr* head = CMSG_FIRSTHDR(&message); head; head = CMSG_NXTHDR(&message, head)) {
    if (head->cmsg_level != SOL_SOCKET || head->cmsg_type != SCM_RIGHTS) continue;
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(head), sizeof descriptor);
    descriptors_.emplace_back(descriptor);
  }
  if (descriptors_.size() > kMaxWaitingDescriptors) malformed("too many descriptors");
  if (got <= 0) throw PeerGone();
  parser_.feed({buffer.data(), static_cast<size_t>(got)});
}

std::optional<Frame> Channel::receive(int wait_ms) {
  for (;;) {
    if (std::optional<Frame> frame = parser_.next()) {
      if (frame->type == FrameType::input) {
        if (descriptors_.empty()) malformed("an input without its descriptor");
        frame->descriptor = std::move(descriptors_.front());
        descriptors_.pop_front();
      }
      return frame;
    }
    if (interrupted_ && interrupted_()) throw Error(ErrorCode::cancelled, "The work was given up.");
    const int slice_ms = wait_ms < 0 ? kPollMs : std::min(wait_ms, kPollMs);
    if (wait_for(POLLIN, slice_ms)) {
      read_some();
    } else if (wait_ms >= 0 && (wait_ms -= slice_ms) <= 0) {
      return std::nullopt;
    }
  }
}

}  // namespace lightkiln
