// Packed bits against frames that were put together by hand, and against the reader of the DBC tests.
#include "drivers/links/can/bits.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "tests/drivers/links/can/dbc_reader.h"

namespace epiline::can {
namespace {

using Bytes = std::array<std::uint8_t, 64>;

Bytes packed(const BitField& field, std::int64_t raw) {
  Bytes data{};
  put_bits(data, field, raw);
  return data;
}

TEST(CanBits, TwelveBitsAcrossBytesInBothOrders) {
  const Bytes little = packed({4, 12, false}, 0xabc), big = packed({3, 12, true}, 0xabc);
  EXPECT_EQ(little[0], 0xc0);
  EXPECT_EQ(little[1], 0xab);
  EXPECT_EQ(big[0], 0x0a);
  EXPECT_EQ(big[1], 0xbc);
}

TEST(CanBits, TheHighestBitIsTheSign) {
  EXPECT_EQ(signed_of(0x800, 12), -2048);
  EXPECT_EQ(signed_of(0x7ff, 12), 2047);
  EXPECT_EQ(signed_of(~std::uint64_t{0}, 64), -1);
  EXPECT_EQ(signed_of(1, 1), -1);
}

RC_GTEST_PROP(CanBits, TheReaderOfDbcFilesReadsWhatIsPacked, (bool big, std::int64_t raw)) {
  const BitField field{*rc::gen::inRange(0, 512), *rc::gen::inRange(1, 65), big};
  RC_PRE(field.bytes() <= 64);
  const Bytes data = packed(field, raw);
  const dbc::SignalText theirs{field.start, field.length, !big, true, 1, 0, 0, 0, "", {}};
  const std::uint64_t kept = ~std::uint64_t{0} >> (64 - field.length);
  RC_ASSERT(dbc::bits_of(theirs, data) == (static_cast<std::uint64_t>(raw) & kept));
  RC_ASSERT(get_bits(data, field) == (static_cast<std::uint64_t>(raw) & kept));
  int ones = 0;  // none beside the field
  for (const std::uint8_t byte : data) ones += __builtin_popcount(byte);
  RC_ASSERT(ones == __builtin_popcountll(static_cast<std::uint64_t>(raw) & kept));
}

}  // namespace
}  // namespace epiline::can
