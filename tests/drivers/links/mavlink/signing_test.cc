// Signatures against those of another implementation (node-mavlink 2.3, its bytes below), and the rules on their times.
#include "drivers/links/mavlink/signing.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/links/mavlink/link.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Verdict = Signing::Verdict;

constexpr const char* kKeyText = "030a11181f262d343b424950575e656c737a81888f969da4abb2b9c0c7ced5dc";
// TIMESYNC of 1/197 on link 0 and of 1/1 on link 5, a hundredth of a second later; HEARTBEAT of 1/1 on link 2 in 2025.
constexpr const char* kOurs = "fd1001000301c56f0000000000000000000035fb048ee0feffff75590000e06f9e75196a069cc75cea";
constexpr const char* kTheirs = "fd1001000401016f0000000000000000000035fb048ee0fefffffffd0564e06f9e75197e4d7ea34ac9";
constexpr const char* kHeartbeat = "fd090100c8010100000004030201020c5104030e9c020040d764461f6f91b23f86c9";
constexpr std::int64_t kMillisecond = 1'000'000, kOurs_ms = 1'700'000'000'000;

SigningKey key() {
  SigningKey key{};
  const Bytes bytes = from_hex(kKeyText);
  std::copy(bytes.begin(), bytes.end(), key.begin());
  return key;
}

std::uint64_t at(std::int64_t unix_ms) { return signing_time_of(unix_ms * kMillisecond); }

/// Of the one frame in these bytes; none: there is no frame.
std::optional<Verdict> verdict_of(Signing& signing, const Bytes& bytes, std::uint64_t now) {
  Parser parser;
  std::span<const std::uint8_t> rest(bytes);
  const Packet* const packet = parser.next(rest);
  return packet == nullptr ? std::nullopt : std::optional(signing.check(parser.raw(), now));
}

FrameBytes question(Address from, std::uint8_t sequence) {
  return frame_of(pack(Timesync{.tc1 = 0, .ts1 = -1'234'567'890'123}, from, sequence), true);
}

Bytes made_by(Signing& signing, Address from, std::uint64_t now) {
  FrameBytes frame = question(from, 0);
  signing.sign(frame, now);
  return {frame.bytes().begin(), frame.bytes().end()};
}

class MavlinkSigning : public testing::Test {
 protected:
  void SetUp() override {
    if (!can_sign()) GTEST_SKIP() << "built without nettle";
  }
};

TEST_F(MavlinkSigning, AnotherImplementationsFramesAreGood) {
  for (const char* frame : {kOurs, kTheirs, kHeartbeat}) {
    Signing signing(key());
    EXPECT_EQ(verdict_of(signing, from_hex(frame), at(kOurs_ms)), Verdict::kGood) << frame;
  }
}

TEST_F(MavlinkSigning, OurFramesAreThoseOfAnotherImplementation) {
  Signing signing(key());
  FrameBytes frame = question({1, 197}, 3);
  const HeapCallScope scope;
  signing.sign(frame, at(kOurs_ms));
  EXPECT_EQ(scope.calls(), 0U);
  EXPECT_EQ(Bytes(frame.bytes().begin(), frame.bytes().end()), from_hex(kOurs));
}

TEST_F(MavlinkSigning, OtherKeysChangedBytesAndUnsignedFramesAreNot) {
  SigningKey other = key();
  other[31] ^= 1;
  Signing stranger(other);
  EXPECT_EQ(verdict_of(stranger, from_hex(kOurs), at(kOurs_ms)), Verdict::kWrong);
  const Bytes good = from_hex(kOurs);
  for (std::size_t i = 28; i < good.size(); ++i) {  // link, time and hash: what the checksum does not cover
    Bytes changed = good;
    changed[i] ^= 0x10;
    Signing signing(key());
    EXPECT_EQ(verdict_of(signing, changed, at(kOurs_ms)), Verdict::kWrong) << i;
  }
  Signing signing(key());
  const FrameBytes plain = frame_of(pack(Heartbeat{}, Address{1, 1}, 0));
  EXPECT_EQ(verdict_of(signing, Bytes(plain.bytes().begin(), plain.bytes().end()), 0), Verdict::kUnsigned);
  const Bytes old_version = from_hex("fe0911090100040302011208050403af08");
  EXPECT_EQ(verdict_of(signing, old_version, 0), Verdict::kUnsigned);
}

TEST_F(MavlinkSigning, AFrameIsGoodOnce) {
  Signing sender(key()), receiver(key());
  const Bytes first = made_by(sender, {1, 1}, at(kOurs_ms)), second = made_by(sender, {1, 1}, at(kOurs_ms));
  EXPECT_EQ(verdict_of(receiver, first, at(kOurs_ms)), Verdict::kGood);
  EXPECT_EQ(verdict_of(receiver, first, at(kOurs_ms)), Verdict::kOld);
  EXPECT_EQ(verdict_of(receiver, second, at(kOurs_ms)), Verdict::kGood) << "its time is later by one";
  EXPECT_EQ(verdict_of(receiver, first, at(kOurs_ms)), Verdict::kOld);
  // another link of the same sender, and another component, count by themselves
  EXPECT_EQ(verdict_of(receiver, from_hex(kTheirs), at(kOurs_ms)), Verdict::kGood);
  Signing late(key());
  EXPECT_EQ(verdict_of(receiver, made_by(late, {1, 2}, at(kOurs_ms - 100)), at(kOurs_ms)), Verdict::kGood);
}

// A recording of last week is no new sender: not against our clock, and not against what others have shown.
TEST_F(MavlinkSigning, ANewSenderIsAtMostAMinuteOld) {
  for (const bool clock_is_set : {true, false}) {
    Signing receiver(key()), sender(key());
    const std::uint64_t now = clock_is_set ? at(kOurs_ms) : 0;
    if (!clock_is_set) {
      Signing honest(key());
      EXPECT_EQ(verdict_of(receiver, made_by(honest, {1, 9}, at(kOurs_ms)), now), Verdict::kGood);
    }
    EXPECT_EQ(verdict_of(receiver, made_by(sender, {1, 1}, at(kOurs_ms - 61'000)), now), Verdict::kOld);
    EXPECT_EQ(verdict_of(receiver, made_by(sender, {1, 1}, at(kOurs_ms - 59'000)), now), Verdict::kGood);
  }
}

TEST_F(MavlinkSigning, SendersAreBounded) {
  Signing receiver(key());
  int good = 0;
  for (std::uint8_t component = 1; component < 200; ++component) {
    Signing sender(key());
    good += verdict_of(receiver, made_by(sender, {1, component}, at(kOurs_ms)), at(kOurs_ms)) == Verdict::kGood;
  }
  EXPECT_EQ(good, 16);
}

// Whatever the clock does, and however late it is set: times rise, and are not behind those of others.
TEST_F(MavlinkSigning, OurTimesRise) {
  Signing us(key()), peer(key());
  EXPECT_EQ(verdict_of(us, from_hex(kHeartbeat), 0),
            Verdict::kGood);  // of 2025, while our clock is at its beginning
  Signing checker(key());
  const std::uint64_t of_2025 = signing_time_of(1'763'942'400'000 * kMillisecond);
  for (const std::uint64_t now : {std::uint64_t{0}, at(kOurs_ms), of_2025 + 10, of_2025 + 5})
    EXPECT_EQ(verdict_of(checker, made_by(us, {1, 197}, now), of_2025), Verdict::kGood) << now;
}

class KeyFile : public MavlinkSigning {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  std::string fault_of(const std::string& text, mode_t mode = 0640) {
    std::ofstream(path_, std::ios::binary) << text;
    ::chmod(path_.c_str(), mode);
    const auto read = read_signing_key(path_);
    EXPECT_TRUE(!read || *read == key());
    return read ? "" : read.error().found;
  }
  std::string path_ = testing::TempDir() + "epiline_key_" + std::to_string(::getpid());
};

TEST_F(KeyFile, HoldsBytesOrDigits) {
  const SigningKey bytes = key();
  const std::string raw(bytes.begin(), bytes.end());
  std::string capitals = kKeyText;
  std::transform(capitals.begin(), capitals.end(), capitals.begin(),
                 [](char c) { return static_cast<char>(std::toupper(c)); });
  for (const std::string& text : {raw, std::string(kKeyText), kKeyText + std::string("\n"), capitals + "\r\n"})
    EXPECT_EQ(fault_of(text), "");
  for (const std::string& text : {std::string(), raw + "x", raw.substr(1), kKeyText + std::string("0"),
                                  std::string(64, 'g'), std::string(1000, '0')})
    EXPECT_EQ(fault_of(text), "mavlink.signing_key_file: not a key") << text;
  EXPECT_EQ(fault_of(kKeyText, 0644), "mavlink.signing_key_file: every user may read it");
  EXPECT_EQ(
      read_signing_key("/does/not/exist").error().text(),
      "/does/not/exist: mavlink.signing_key_file: No such file or directory [open]; expected a file that the user of "
      "epiline may read");
}

// On a line: what is not signed with the key is as if it had not come, and all that goes out is signed.
TEST_F(KeyFile, MakesALinkSignAndCheck) {
  ASSERT_EQ(fault_of(kKeyText), "");
  LinkOnALine rig(config_with(&MavlinkConfig::signing_key_file, path_));
  rig.begin();
  FakeLine& line = rig.line;
  const MavlinkLink& link = rig.link;
  Signing controller(key()), forger(SigningKey{});
  const auto send_signed = [&](Signing& signing, std::uint64_t now) {
    FrameBytes frame = frame_of(pack(Heartbeat{.type = 2, .autopilot = 12}, Address{1, 1}, 0), true);
    signing.sign(frame, now);
    line.peer.send_bytes(frame.bytes());
    return frame;
  };
  line.peer.heartbeat();
  send_signed(forger, signing_time_now());
  ASSERT_TRUE(rig.wait_for([&] { return link.counts().packets >= 2; }));
  EXPECT_FALSE(link.state().peer.is_known);
  const FrameBytes frame = send_signed(controller, signing_time_now());
  ASSERT_TRUE(rig.wait_for([&] { return link.state().peer.is_known; }));
  line.peer.send_bytes(frame.bytes());
  ASSERT_TRUE(rig.wait_for([&] { return link.counts().replayed_packets >= 1; }));
  EXPECT_EQ(link.counts().unsigned_packets, 1U);
  EXPECT_EQ(link.counts().wrong_signatures, 1U);
  Signing checker(key());
  Parser parser;
  int odometry = 0;
  for (int i = 0; i < 100; ++i) {
    rig.estimates.step(rig.link, line.now_ns());
    rig.advance(5 * kMs);
    const Bytes sent(line.peer.terminal->to_peer.begin(), line.peer.terminal->to_peer.end());
    line.peer.terminal->to_peer.clear();
    std::span<const std::uint8_t> bytes(sent);
    while (const Packet* const packet = parser.next(bytes)) {
      EXPECT_EQ(checker.check(parser.raw(), signing_time_now()), Verdict::kGood);
      odometry += packet->id == mavlink::Odometry::kId;
    }
  }
  EXPECT_GE(odometry, 10);
  EXPECT_EQ(parser.skipped_bytes(), 0U);
}

}  // namespace
}  // namespace epiline::mavlink
