// Frames against those of another implementation (node-mavlink 2.3, its bytes below), and through noise. Members but
// for extensions are in the seeds of the checksums, which the compiler checks.
#include "drivers/links/mavlink/packet.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes bytes_of(const FrameBytes& frame) { return {frame.bytes().begin(), frame.bytes().end()}; }

/// All packets of a stream that comes in pieces of `piece` bytes.
std::vector<Packet> packets_in(Parser& parser, const Bytes& stream, std::size_t piece) {
  std::vector<Packet> packets;
  for (std::size_t at = 0; at < stream.size(); at += piece) {
    std::span<const std::uint8_t> bytes(stream.data() + at, std::min(piece, stream.size() - at));
    while (const Packet* p = parser.next(bytes)) packets.push_back(*p);
  }
  return packets;
}

/// The bits of all fields, so that numbers that are none compare as well.
template <class Message>
Bytes bits(const Message& message) {
  Bytes all;
  for_each_field<Message>([&](const auto& f) {
    const auto& value = message.*f.member;
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(&value);
    all.insert(all.end(), bytes, bytes + sizeof value);
  });
  return all;
}

template <class Message>
void expect_golden(const Message& message, std::uint8_t sequence, const std::string& hex) {
  const Bytes golden = from_hex(hex);
  EXPECT_EQ(bytes_of(frame_of(pack(message, Address{}, sequence))), golden) << Message::kId;
  Parser parser;
  const auto packets = packets_in(parser, golden, golden.size());
  ASSERT_EQ(packets.size(), 1U) << Message::kId;
  Message back;
  ASSERT_TRUE(unpack(packets[0], back));
  EXPECT_EQ(bits(back), bits(message)) << Message::kId;
  EXPECT_EQ(packets[0].sequence, sequence);
  EXPECT_EQ(packets[0].from.component, 197);
}

Timesync question() { return {.tc1 = 0, .ts1 = -1234567890123, .target_system = 1}; }
const char* const kQuestion = "fd110000ff01c56f0000000000000000000035fb048ee0feffff019713";

TEST(MavlinkFrames, AreThoseOfAnotherImplementation) {
  expect_golden(Heartbeat{.custom_mode = 0x01020304, .base_mode = 5, .system_status = 4}, 250,
                "fd090000fa01c50000000403020112080504030364");
  expect_golden(RawImu{123456789, -1000, 20, 981, -3, 4, -5, 300, -301, 302, 2, 4521}, 252,
                "fd1d0000fc01c51b000015cd5b070000000018fc1400d503fdff0400fbff2c01d3fe2e0102a911cef3");
  VisionPositionEstimate vision{5000001, 1.5F, -2.25F, 3.125F, 0.5F, -0.25F, 3, {}, 7};
  for (std::size_t i = 0; i < 21; ++i) vision.covariance[i] = 0.5F * static_cast<float>(i);
  expect_golden(
      vision, 253,
      "fd750000fd01c5660000414b4c00000000000000c03f000010c0000048400000003f000080be00004040000000000000003f0000"
      "803f0000c03f0000004000002040000040400000604000008040000090400000a0400000b0400000c0400000d0400000e0400000"
      "f040000000410000084100001041000018410000204107ddbf");
  expect_golden(
      HighresImu{99, 0.5F, -9.75F, 1, 2, 3, 4, 5, 6, 7, 1013.25F, -1, 8, 36.5F, 0x1ff, 0}, 254,
      "fd3e0000fe01c569000063000000000000000000003f00001cc10000803f0000004000004040000080400000a0400000c0400000"
      "e04000507d44000080bf0000004100001242ff012168");
  expect_golden(question(), 255, kQuestion);
  expect_golden(CommandAck{511, 4, 9, -123456, 1, 197}, 8, "fd0a00000801c54d0000ff010409c01dfeff01c5b27a");
  expect_golden(SetGpsGlobalOrigin{473566094, -85190237, 408123, 1, 1234567890123}, 9,
                "fd1300000901c53000008e0b3a1ca319ecfa3b3a060001cb04fb711f01ea32");
  StatusText text{.severity = 4};
  std::strcpy(text.text.data(), "epiline: lost");
  expect_golden(text, 0, "fd0e00000001c5fd0000046570696c696e653a206c6f737464e0");
  Odometry odometry{.time_usec = 1234567890, .x = 1, .y = -2, .z = 3, .q = {0.5F, -0.5F, 0.5F, -0.5F}};
  odometry.vx = 0.25F;
  odometry.vy = -0.75F;
  odometry.vz = 4;
  odometry.rollspeed = 0.125F;
  odometry.pitchspeed = -0.0625F;
  odometry.yawspeed = 9;
  for (std::size_t i = 0; i < 21; ++i) {
    odometry.pose_covariance[i] = static_cast<float>(i) + 1;
    odometry.velocity_covariance[i] = -static_cast<float>(i) - 0.5F;
  }
  odometry.reset_counter = 200;
  odometry.quality = -1;
  expect_golden(
      odometry, 1,
      "fde900000101c54b0100d2029649000000000000803f000000c0000040400000003f000000bf0000003f000000bf0000803e0000"
      "40bf000080400000003e000080bd000010410000803f0000004000004040000080400000a0400000c0400000e040000000410000"
      "1041000020410000304100004041000050410000604100007041000080410000884100009041000098410000a0410000a8410000"
      "00bf0000c0bf000020c0000060c0000090c00000b0c00000d0c00000f0c0000008c1000018c1000028c1000038c1000048c10000"
      "58c1000068c1000078c1000084c100008cc1000094c100009cc10000a4c1140cc803ffad45");
  ParamValue value{1.5F, 900, 65'535};
  std::memcpy(value.param_id.data(), "EKF2_EV_NOISE_MD", 16);  // all of it, without a zero
  expect_golden(value, 8, "fd1900000801c51600000000c03f8403ffff454b46325f45565f4e4f4953455f4d440962a4");
  AutopilotVersion version{.capabilities = 5, .uid = 6, .flight_sw_version = 0x011200ff, .middleware_sw_version = 2};
  version.os_sw_version = 3;
  version.board_version = 50;
  version.vendor_id = 9;
  version.product_id = 10;
  version.flight_custom_version = {1, 2, 3, 4, 5, 6, 7, 8};
  version.os_custom_version[7] = 9;
  expect_golden(
      version, 9,
      "fd3c00000901c594000005000000000000000600000000000000ff00120102000000030000003200000009000a00010203040506"
      "070800000000000000000000000000000009ec38");
  expect_golden(EkfStatusReport{0.5F, 0.25F, 0.125F, 1, 2, 0x33f, 4}, 10,
                "fd1a00000a01c5c100000000003f0000803e0000003e0000803f000000403f030000804065eb");
  expect_golden(GpsGlobalOrigin{473977419, 85455938, 488000, 987654321}, 12,
                "fd1000000c01c53100004b52401c42f4170540720700b168de3a137c");
}

TEST(MavlinkFrames, OfVersionOneAreRead) {
  Parser parser;
  const auto packets = packets_in(parser, from_hex("fe0911090100040302011208050403af08"), 1);
  ASSERT_EQ(packets.size(), 1U);
  Heartbeat heartbeat;
  ASSERT_TRUE(unpack(packets[0], heartbeat));
  EXPECT_EQ(heartbeat.custom_mode, 0x01020304U);
  EXPECT_EQ(packets[0].sequence, 17);
  EXPECT_EQ(packets[0].from.system, 9);
  EXPECT_EQ(packets[0].from.component, 1);
}

TEST(MavlinkFrames, WithASignatureAreRead) {
  // node-mavlink's frame and signature; another frame behind it
  Bytes stream = from_hex("fd1101000301c56f0000000000000000000035fb048ee0feffff01707d0100e06f9e75195a365d929474");
  const Bytes behind = from_hex(kQuestion);
  stream.insert(stream.end(), behind.begin(), behind.end());
  Parser parser;
  const auto packets = packets_in(parser, stream, 7);
  ASSERT_EQ(packets.size(), 2U);
  Timesync first;
  ASSERT_TRUE(unpack(packets[0], first));
  EXPECT_EQ(bits(first), bits(question()));
  EXPECT_EQ(parser.skipped_bytes(), 0U);
}

TEST(MavlinkFrames, UnpackRefusesAnotherMessage) {
  Heartbeat heartbeat{.custom_mode = 5};
  EXPECT_FALSE(unpack(pack(question(), Address{}, 0), heartbeat));
  EXPECT_EQ(heartbeat.custom_mode, 5U);
}

/// A message of any bits.
template <class Message>
Message any_message() {
  Packet packet;
  packet.id = Message::kId;
  const auto bytes = *rc::gen::container<Bytes>(length_of<Message>(), rc::gen::arbitrary<std::uint8_t>());
  std::copy(bytes.begin(), bytes.end(), packet.payload.begin());
  // ends in zeros more often than chance has it: those do not travel
  const auto zeros = *rc::gen::inRange<std::size_t>(0, bytes.size() + 1);
  std::fill_n(packet.payload.begin() + static_cast<std::ptrdiff_t>(bytes.size() - zeros), zeros, std::uint8_t{0});
  Message message;
  unpack(packet, message);
  return message;
}

template <class Message>
void there_and_back() {
  const Message message = any_message<Message>();
  const auto sequence = *rc::gen::arbitrary<std::uint8_t>();
  const FrameBytes frame = frame_of(pack(message, Address{3, 4}, sequence));
  Parser parser;
  const auto packets = packets_in(parser, bytes_of(frame), *rc::gen::inRange<std::size_t>(1, 300));
  RC_ASSERT(packets.size() == 1U);
  Message back;
  RC_ASSERT(unpack(packets[0], back));
  RC_ASSERT(bits(back) == bits(message));
  RC_ASSERT(packets[0].sequence == sequence);
}

RC_GTEST_PROP(MavlinkFrames, ComeBackAsTheyWere, ()) {
  there_and_back<Heartbeat>();
  there_and_back<RawImu>();
  there_and_back<CommandAck>();
  there_and_back<StatusText>();
  there_and_back<DistanceSensor>();
  there_and_back<AutopilotVersion>();
  there_and_back<Odometry>();
}

/// Bytes that look like the beginnings of frames more often than chance has it.
Bytes noise() {
  const auto byte = rc::gen::weightedOneOf<std::uint8_t>({{3, rc::gen::element<std::uint8_t>(0xfd, 0xfe)},
                                                          {3, rc::gen::element<std::uint8_t>(0, 2, 9, 27, 255)},
                                                          {4, rc::gen::arbitrary<std::uint8_t>()}});
  return *rc::gen::container<Bytes>(*rc::gen::inRange<std::size_t>(0, 400), byte);
}

// However noise and pieces fall, every frame comes out, once and in order. Behind the last one there are enough bytes
// to decide what looked like a frame before it.
RC_GTEST_PROP(MavlinkParser, LosesNoFrameToNoise, ()) {
  Bytes stream;
  const auto count = *rc::gen::inRange(1, 8);
  for (int i = 0; i < count; ++i) {
    const Bytes before = noise();
    stream.insert(stream.end(), before.begin(), before.end());
    const Bytes frame =
        bytes_of(frame_of(pack(any_message<Odometry>(), Address{77, 88}, static_cast<std::uint8_t>(i))));
    stream.insert(stream.end(), frame.begin(), frame.end());
  }
  stream.resize(stream.size() + kMaxFrame);
  Parser parser;
  std::vector<int> seen;
  for (const Packet& p : packets_in(parser, stream, *rc::gen::inRange<std::size_t>(1, 700)))
    if (p.id == Odometry::kId && p.from.system == 77 && p.from.component == 88) seen.push_back(p.sequence);
  std::vector<int> expected;
  for (int i = 0; i < count; ++i) expected.push_back(i);
  RC_ASSERT(seen == expected);
}

// One flipped bit anywhere: the frame is refused, the next one is not.
TEST(MavlinkParser, RefusesEverySingleBitError) {
  const Bytes sound = bytes_of(frame_of(pack(Odometry{.time_usec = 77, .x = 1.5F}, Address{}, 5)));
  for (std::size_t bit = 0; bit < 8 * sound.size(); ++bit) {
    Bytes stream = sound;
    stream[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    stream.insert(stream.end(), sound.begin(), sound.end());
    stream.resize(stream.size() + kMaxFrame);
    Parser parser;
    ASSERT_EQ(packets_in(parser, stream, 50).size(), 1U) << "bit " << bit;
  }
}

TEST(MavlinkParser, GivesAPacketWithItsLastByte) {
  const Bytes frame = from_hex(kQuestion);
  Parser parser;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    std::span<const std::uint8_t> byte(&frame[i], 1);
    EXPECT_EQ(parser.next(byte) != nullptr, i + 1 == frame.size());
  }
}

// Nobody has to wait for the rest of a frame that can be seen to be none by its header.
TEST(MavlinkParser, IsNotHeldUpByHeadersOfNoMessage) {
  for (const char* header :
       {"fec80001010000", "fdc80000010101ffffff", "fdc80200010101000000", "fd000000010101000000"}) {
    Bytes stream = from_hex(header);
    const Bytes frame = from_hex(kQuestion);
    stream.insert(stream.end(), frame.begin(), frame.end());
    Parser parser;
    EXPECT_EQ(packets_in(parser, stream, 1).size(), 1U) << header;
  }
}

TEST(MavlinkParser, CountsWhatItSees) {
  Bytes stream = {1, 2, 3};
  Bytes frame = from_hex(kQuestion);
  stream.insert(stream.end(), frame.begin(), frame.end());
  frame.back() ^= 1;
  stream.insert(stream.end(), frame.begin(), frame.end());
  Parser parser;
  EXPECT_EQ(packets_in(parser, stream, 10).size(), 1U);
  EXPECT_EQ(parser.packets(), 1U);
  EXPECT_EQ(parser.bad_checksums(), 1U);
  EXPECT_EQ(parser.skipped_bytes(), 3 + frame.size());
}

}  // namespace
}  // namespace epiline::mavlink
