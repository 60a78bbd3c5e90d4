// Scans against a writer that builds them bit by bit, by the words of the kernel's documentation (buffers,
// scan_elements).
#include "drivers/sensors/imu/iio_scan.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace epiline {
namespace {

IioType type_of(const char* text) {
  IioType type;
  EXPECT_TRUE(parse_iio_type(text, type)) << text;
  return type;
}

TEST(IioScan, TypesAreReadAsTheKernelWritesThem) {
  EXPECT_EQ(type_of("le:s16/16>>0"), (IioType{.is_signed = true, .bits = 16, .storage_bits = 16}));
  EXPECT_EQ(type_of("be:u12/32X4>>4"),
            (IioType{.is_big_endian = true, .bits = 12, .storage_bits = 32, .repeat = 4, .shift = 4}));
  IioType type;
  for (const char* wrong : {"",
                            "le",
                            "le:",
                            "xe:s16/16>>0",
                            "le:f16/16>>0",
                            "le:s16/16",
                            "le:s16/16>>",
                            "le:s16/16>>0 ",
                            "le:s0/16>>0",
                            "le:s16/17>>0",
                            "le:s16/128>>0",
                            "le:s17/16>>0",
                            "le:s16/16>>1",
                            "le:s8/16>>9",
                            "le:s16/16X0>>0",
                            "le:s16/16X17>>0",
                            "le:s-1/16>>0",
                            "le:s1000000000000/16>>0",
                            "le:s16/16X>>0",
                            "le:s16/0>>0"})
    EXPECT_FALSE(parse_iio_type(wrong, type)) << wrong;
}

// As iio_compute_scan_bytes() of the kernel 6.1 lays them out; figures of real drivers' channels.
TEST(IioScan, ElementsAreAlignedToTheirOwnLength) {
  IioScanLayout layout;
  const IioType axis = type_of("be:s16/16>>0"), stamp = type_of("le:s64/64>>0");
  ASSERT_TRUE(layout.add(IioChannel::kTimestamp, 3, stamp));
  ASSERT_TRUE(layout.add(IioChannel::kGyroscopeX, 0, axis));
  ASSERT_TRUE(layout.add(IioChannel::kGyroscopeZ, 2, axis));
  ASSERT_TRUE(layout.add(IioChannel::kGyroscopeY, 1, axis));
  EXPECT_FALSE(layout.add(IioChannel::kOther, 2, axis)) << "the same index";
  ASSERT_TRUE(layout.finish());
  EXPECT_EQ(layout.bytes(), 16u);
  const std::vector<std::uint8_t> bytes{0x00, 0x01, 0xFF, 0xFE, 0x7F, 0xFF, 0xAA, 0xAA,
                                        0x08, 0x07, 0x06, 0x05, 0x04, 0x03, 0x02, 0x01};
  IioScan scan;
  scan.axes[3] = 42;
  layout.read(bytes, scan);
  EXPECT_EQ(scan.axes[0], 1);
  EXPECT_EQ(scan.axes[1], -2);
  EXPECT_EQ(scan.axes[2], 32'767);
  EXPECT_EQ(scan.axes[3], 42) << "not in the scan";
  EXPECT_EQ(scan.stamp_ns, 0x0102030405060708);
}

TEST(IioScan, NeedsATime) {
  IioScanLayout layout;
  EXPECT_FALSE(layout.finish());
  ASSERT_TRUE(layout.add(IioChannel::kGyroscopeX, 0, type_of("le:s16/16>>0")));
  EXPECT_FALSE(layout.finish());
  ASSERT_TRUE(layout.add(IioChannel::kTimestamp, 1, type_of("le:s32/32>>0")));
  EXPECT_FALSE(layout.finish());
}

RC_GTEST_PROP(IioScan, EveryLayoutGivesBackWhatWasWritten, ()) {
  const int count = *rc::gen::inRange(1, 7);
  std::vector<IioType> types;
  std::vector<std::int64_t> values;
  std::vector<std::uint8_t> bytes;
  IioScanLayout layout;
  std::size_t longest = 8;
  const auto pad = [&](std::size_t to) {
    while (bytes.size() % to != 0) bytes.push_back(*rc::gen::arbitrary<std::uint8_t>());
  };
  const auto put = [&](const IioType& type, std::uint64_t value) {
    const auto storage = static_cast<std::size_t>(type.storage_bits / 8);
    pad(storage * static_cast<std::size_t>(type.repeat));
    const std::size_t begin = bytes.size();
    // what is not the value is arbitrary
    std::uint64_t word = *rc::gen::arbitrary<std::uint64_t>();
    const std::uint64_t ones = type.bits == 64 ? ~0ull : (1ull << type.bits) - 1;
    word = (word & ~(ones << type.shift)) | (value & ones) << type.shift;
    for (std::size_t i = 0; i < storage; ++i) {
      const std::size_t at = type.is_big_endian ? storage - 1 - i : i;
      bytes.push_back(static_cast<std::uint8_t>(word >> (8 * at)));
    }
    while (bytes.size() < begin + storage * static_cast<std::size_t>(type.repeat)) bytes.push_back(0x55);
  };
  for (int i = 0; i < count; ++i) {
    IioType type;
    type.is_big_endian = *rc::gen::arbitrary<bool>();
    type.is_signed = *rc::gen::arbitrary<bool>();
    type.storage_bits = 8 << *rc::gen::inRange(0, 4);
    type.bits = *rc::gen::inRange(1, std::min(type.storage_bits, 53) + 1);  // doubles hold these exactly
    type.shift = *rc::gen::inRange(0, type.storage_bits - type.bits + 1);
    type.repeat = *rc::gen::element(1, 1, 1, 2, 4);
    const std::int64_t least = type.is_signed ? -(std::int64_t{1} << (type.bits - 1)) : 0;
    const std::int64_t most =
        type.is_signed ? (std::int64_t{1} << (type.bits - 1)) - 1 : (std::int64_t{1} << type.bits) - 1;
    const std::int64_t value = *rc::gen::element(least, most, *rc::gen::inRange<std::int64_t>(least, most + 1));
    put(type, static_cast<std::uint64_t>(value));
    values.push_back(value);
    longest = std::max(longest, static_cast<std::size_t>(type.storage_bits / 8 * type.repeat));
    RC_ASSERT(layout.add(static_cast<IioChannel>(i), 10 * i, type));
  }
  const std::int64_t stamp = *rc::gen::arbitrary<std::int64_t>();
  IioType of_stamp = type_of("le:s64/64>>0");
  put(of_stamp, static_cast<std::uint64_t>(stamp));
  pad(longest);
  RC_ASSERT(layout.add(IioChannel::kTimestamp, 1, of_stamp));  // its index does not matter
  RC_ASSERT(layout.finish());
  RC_ASSERT(layout.bytes() == bytes.size());
  IioScan scan;
  layout.read(bytes, scan);
  for (std::size_t i = 0; i < values.size(); ++i) RC_ASSERT(scan.axes[i] == static_cast<double>(values[i]));
  RC_ASSERT(scan.stamp_ns == stamp);
}

}  // namespace
}  // namespace epiline
