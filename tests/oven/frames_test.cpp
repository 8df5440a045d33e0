#include "server/oven/frames.h"

#include <thread>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace lightkiln {
namespace {

std::pair<Descriptor, Descriptor> socket_pair() {
  int ends[2];
  EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

std::vector<Frame> parse_in_pieces(const std::string& stream, const std::vector<size_t>& cuts) {
  FrameParser parser;
  std::vector<Frame> frames;
  size_t position = 0, turn = 0;
  while (position < stream.size()) {
    const size_t piece = cuts.empty() ? stream.size() : 1 + cuts[turn++ % cuts.size()] % 97;
    parser.feed(std::string_view(stream).substr(position, piece));
    position += piece;
    while (std::optional<Frame> frame = parser.next()) frames.push_back(std::move(*frame));
  }
  return frames;
}

RC_GTEST_PROP(Frames, SurviveAnyTearing,
              (const std::vector<std::string>& payloads, const std::vector<size_t>& cuts)) {
  std::string stream;
  for (size_t i = 0; i < payloads.size(); ++i)
    stream += frame_header(static_cast<FrameType>(1 + i % kLastFrameType), payloads[i].size()) +
              payloads[i];
  const std::vector<Frame> frames = parse_in_pieces(stream, cuts);
  RC_ASSERT(frames.size() == payloads.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    RC_ASSERT(frames[i].payload == payloads[i]);
    RC_ASSERT(frames[i].type == static_cast<FrameType>(1 + i % kLastFrameType));
  }
}

RC_GTEST_PROP(Frames, NoiseIsAnErrorAndNeverACrash, (const std::string& noise)) {
  FrameParser parser;
  try {
    parser.feed(frame_header(FrameType::progress, 3) + "abc" + noise);
  } catch (const Error& error) {
    RC_ASSERT(error.code() == ErrorCode::internal);
  }
  RC_ASSERT(parser.next()->payload == "abc");
}

RC_GTEST_PROP(Frames, PayloadsReadBackAndNeverReadOver,
              (uint64_t number, const std::string& text, size_t cut)) {
  const std::string payload = PayloadWriter().number(number).text(text).real(0.5).take();
  PayloadReader whole(payload);
  RC_ASSERT(whole.number() == number);
  RC_ASSERT(whole.text() == text);
  RC_ASSERT(whole.real() == 0.5);
  whole.end();
  PayloadReader torn(std::string_view(payload).substr(0, cut % payload.size()));
  RC_ASSERT_THROWS_AS((torn.number(), torn.text(), torn.real()), Error);
}

TEST(Frames, ALengthOverItsCapIsRefusedBeforeMemoryIsTaken) {
  FrameParser parser;
  EXPECT_THROW(parser.feed(frame_header(FrameType::progress, 1ull << 40)), Error);
  FrameParser patient;
  patient.feed(frame_header(FrameType::artifact, max_payload(FrameType::artifact)));
  EXPECT_FALSE(patient.next()) << "two gigabytes announced, none taken";
}

TEST(Frames, AnUnknownTypeIsRefused) {
  FrameParser parser;
  EXPECT_THROW(parser.feed(frame_header(static_cast<FrameType>(kLastFrameType + 1), 0)), Error);
}

TEST(Channel, CarriesLargeFramesAndDescriptorsBothWays) {
  auto [left, right] = socket_pair();
  Channel a(std::move(left)), b(std::move(right));
  const std::string large(5'000'000, 'x');
  char name[] = "/tmp/lightkiln-frame-XXXXXX";
  Descriptor file(mkstemp(name));
  unlink(name);
  ASSERT_EQ(write(file.get(), "blob", 4), 4);
  std::thread sender([&] {
    a.send(FrameType::artifact, large);
    a.send(FrameType::input, PayloadWriter().text("digest").take(), file.get());
  });
  EXPECT_EQ(b.receive(-1)->payload, large);
  const std::optional<Frame> input = b.receive(-1);
  sender.join();
  char text[5] = {};
  EXPECT_EQ(pread(input->descriptor.get(), text, 4, 0), 4);
  EXPECT_STREQ(text, "blob");
  EXPECT_FALSE(a.receive(10)) << "nothing was sent back";
}

TEST(Channel, AnInputWithoutItsDescriptorIsAnError) {
  auto [left, right] = socket_pair();
  Channel a(std::move(left)), b(std::move(right));
  a.send(FrameType::input, PayloadWriter().text("digest").take());
  EXPECT_THROW(b.receive(-1), Error);
}

TEST(Channel, TellsThatThePeerIsGone) {
  auto [left, right] = socket_pair();
  Channel a(std::move(left));
  right.reset();
  EXPECT_THROW(a.receive(-1), PeerGone);
  EXPECT_THROW(a.send(FrameType::plan, {}), PeerGone);
}

TEST(Channel, AnInterruptEndsWaitingAndSending) {
  auto [left, right] = socket_pair();
  Channel a(std::move(left), [] { return true; });
  EXPECT_THROW(a.receive(-1), Error);
  EXPECT_THROW(a.send(FrameType::artifact, std::string(10'000'000, 'x')), Error);
}

}  // namespace
}  // namespace lightkiln
