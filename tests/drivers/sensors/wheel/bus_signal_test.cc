// Signals against frames that were put together by hand, and against the reader of the DBC tests.
#include "drivers/sensors/wheel/bus_signal.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <vector>

#include "tests/drivers/links/can/dbc_reader.h"

namespace epiline {
namespace {

using Bytes = std::vector<std::uint8_t>;

// 0x1234 and 0xabc as tools for DBC files draw them: little-endian from the lowest bit on; big-endian with the highest
// bit at the start, which counts from the right in each byte.
TEST(BusSignal, FramesByHand) {
  struct Case {
    BusSignal signal;
    Bytes bytes;
    double value;
  };
  const BusSignal speed{.start_bit = 0, .length = 12, .is_signed = true, .scale = 0.25, .offset = -3};
  for (const Case& c : {Case{{.start_bit = 8, .length = 16}, {0xff, 0x34, 0x12, 0xff}, 0x1234},
                        {{.start_bit = 15, .length = 16, .big_endian = true}, {0xff, 0x12, 0x34, 0xff}, 0x1234},
                        {{.start_bit = 4, .length = 12}, {0xc0, 0xab}, 0xabc},
                        {{.start_bit = 3, .length = 12, .big_endian = true}, {0x0a, 0xbc}, 0xabc},
                        {speed, {0xff, 0x0f}, -3.25},
                        {speed, {0x00, 0x08}, -2048 * 0.25 - 3},
                        {speed, {0xff, 0xf7}, 2047 * 0.25 - 3},
                        {{.start_bit = 0, .length = 64, .is_signed = true}, Bytes(8, 0xff), -1},
                        {{.start_bit = 0, .length = 64}, Bytes(8, 0xff), 18446744073709551616.0}})
    EXPECT_EQ(value_of(c.signal, c.bytes), c.value) << c.signal.start_bit << "|" << c.signal.length;
}

TEST(BusSignal, ShortFramesAndSenselessSettingsSayNothing) {
  const BusSignal speed{.start_bit = 8, .length = 16};
  EXPECT_EQ(bytes_of(speed), 3);
  EXPECT_FALSE(value_of(speed, Bytes{1, 2}));
  EXPECT_FALSE(value_of(speed, Bytes{}));
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(value_of({.start_bit = 0, .length = 8, .scale = nan}, Bytes{1}));
  EXPECT_FALSE(value_of({.start_bit = 0, .length = 8, .scale = inf}, Bytes{1}));
  EXPECT_FALSE(value_of({.start_bit = 0, .length = 8, .scale = inf}, Bytes{0}));
  EXPECT_EQ(bytes_of({.start_bit = 0, .length = 0}), 0);
  EXPECT_EQ(bytes_of({.start_bit = 0, .length = 65}), 0);
  EXPECT_EQ(bytes_of({.start_bit = -1, .length = 8}), 0);
  EXPECT_EQ(bytes_of({.start_bit = 505, .length = 8}), 0);
  EXPECT_EQ(bytes_of({.start_bit = 504, .length = 8}), 64);
  EXPECT_EQ(bytes_of({.start_bit = 505, .length = 8, .big_endian = true}), 0);
  EXPECT_EQ(bytes_of({.start_bit = 511, .length = 8, .big_endian = true}), 64);
}

RC_GTEST_PROP(BusSignal, ReadsWhatTheReaderOfDbcFilesReads, (bool big, bool is_signed)) {
  const int start = *rc::gen::inRange(0, 512), length = *rc::gen::inRange(1, 65);
  const BusSignal ours{.start_bit = start, .length = length, .big_endian = big, .is_signed = is_signed};
  RC_PRE(bytes_of(ours) != 0);
  const auto data = *rc::gen::container<Bytes>(64, rc::gen::arbitrary<std::uint8_t>());
  const dbc::SignalText theirs{start, length, !big, is_signed, 1, 0, 0, 0, "", {}};
  const auto value = value_of(ours, data);
  RC_ASSERT(value.has_value());
  const std::uint64_t bits = dbc::bits_of(theirs, data);
  if (!is_signed || length == 64) {
    RC_ASSERT(*value == (is_signed ? static_cast<double>(static_cast<std::int64_t>(bits)) : static_cast<double>(bits)));
  } else {
    RC_ASSERT(*value == static_cast<double>(dbc::read(theirs, data).raw));
  }
  // one byte less is too little, and nothing beyond is looked at
  const auto needed = static_cast<std::size_t>(bytes_of(ours));
  RC_ASSERT(value_of(ours, {data.data(), needed}) == value);
  RC_ASSERT(!value_of(ours, {data.data(), needed - 1}));
}

}  // namespace
}  // namespace epiline
