#include "drivers/sensors/imu/icm42688p_packet.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline {
namespace {

// Bytes put together by hand from the tables of section 6.1.
TEST(IcmPacket, ShortOnesHaveSixteenBitsAValue) {
  const std::vector<std::uint8_t> bytes{0x68, 0x00, 0x01, 0xff, 0xff, 0x08, 0x00, 0x7f,
                                        0xff, 0x80, 0x02, 0x12, 0x34, 0xf6, 0xab, 0xcd};
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kShort, packet), IcmParse::kData);
  EXPECT_EQ(packet.accel, (std::array<std::int32_t, 3>{1, -1, 2048}));
  EXPECT_EQ(packet.gyro, (std::array<std::int32_t, 3>{32767, -32766, 0x1234}));
  EXPECT_TRUE(packet.is_valid);
  EXPECT_EQ(packet.timestamp, 0xabcd);
  EXPECT_NEAR(packet.temperature_c, -10 / 2.07 + 25, 1e-12);
}

TEST(IcmPacket, LongOnesHaveTwentyBitsAValue) {
  const std::vector<std::uint8_t> bytes{0x78, 0x7f, 0xff, 0x80, 0x02, 0xff, 0xff, 0x00, 0x10, 0xff,
                                        0xf0, 0x80, 0x02, 0x03, 0x1b, 0x00, 0x2a, 0xc2, 0x0e, 0x4c};
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kLong, packet), IcmParse::kData);
  EXPECT_EQ(packet.accel, (std::array<std::int32_t, 3>{524284, -524256, -12}));
  EXPECT_EQ(packet.gyro, (std::array<std::int32_t, 3>{258, -242, -524244}));
  EXPECT_EQ(packet.timestamp, 42);
  EXPECT_NEAR(packet.temperature_c, 31, 0.005);
}

TEST(IcmPacket, AValueThatSaysInvalidMakesThePacketSo) {
  std::vector<std::uint8_t> bytes(16, 0);
  bytes[0] = 0x6b;  // the rate has changed: no matter
  bytes[9] = 0x80;
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kShort, packet), IcmParse::kData);
  EXPECT_FALSE(packet.is_valid);
}

TEST(IcmPacket, EveryOtherHeaderIsTheEndOrDamage) {
  for (int header = 0; header < 256; ++header) {
    std::vector<std::uint8_t> bytes(20, 0);
    bytes[0] = static_cast<std::uint8_t>(header);
    IcmPacket packet;
    const IcmParse outcome = parse_icm_packet(bytes, IcmPacketKind::kLong, packet);
    const IcmParse wanted = header >= 0x78 && header <= 0x7b   ? IcmParse::kData
                            : header == 0x80 || header == 0xff ? IcmParse::kEmpty
                                                               : IcmParse::kDamaged;
    EXPECT_EQ(outcome, wanted) << header;
  }
}

}  // namespace
}  // namespace epiline
