#pragma once
// Bits of a CAN frame as integers. This is the only place where the program packs and unpacks them.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace epiline::can {

/// `start` counts as DBC files do: bit 0 is the lowest of byte 0, bit 15 the highest of byte 1. Little-endian: it is
/// the field's lowest bit. Big-endian: its highest; the next lower ones follow downwards, then in the next byte.
struct BitField {
  int start = 0, length = 0;  ///< bits; 1 to 64
  bool big_endian = false;

  /// The lowest bit, as DBC files count.
  constexpr int lowest_bit() const {
    if (!big_endian) return start;
    const int in_reading_order = start / 8 * 8 + 7 - start % 8 + length - 1;
    return in_reading_order / 8 * 8 + 7 - in_reading_order % 8;
  }
  /// Bytes that a frame must have to hold the field.
  constexpr int bytes() const { return (big_endian ? lowest_bit() : start + length - 1) / 8 + 1; }
};

/// visit(byte, offset, count) for each run of bits in one byte, from the field's lowest bit to its highest.
template <class Visit>
constexpr void for_each_run(const BitField& field, Visit visit) {
  const int lowest = field.lowest_bit(), step = field.big_endian ? -1 : 1;
  int byte = lowest / 8, offset = lowest % 8;
  for (int rest = field.length; rest > 0; byte += step, offset = 0) {
    const int count = std::min(8 - offset, rest);
    visit(static_cast<std::size_t>(byte), offset, count);
    rest -= count;
  }
}

/// Writes the lowest bits of `raw` into the field, which is zero. The field lies within `data`.
constexpr void put_bits(std::span<std::uint8_t> data, const BitField& field, std::int64_t raw) {
  auto rest = static_cast<std::uint64_t>(raw);
  for_each_run(field, [&](std::size_t byte, int offset, int count) {
    const std::uint64_t mask = (std::uint64_t{1} << count) - 1;
    data[byte] = static_cast<std::uint8_t>(data[byte] | (rest & mask) << offset);
    rest >>= count;
  });
}

/// What the field holds, as an unsigned number. The field lies within `data`.
constexpr std::uint64_t get_bits(std::span<const std::uint8_t> data, const BitField& field) {
  std::uint64_t raw = 0;
  int done = 0;
  for_each_run(field, [&](std::size_t byte, int offset, int count) {
    const std::uint64_t mask = (std::uint64_t{1} << count) - 1;
    raw |= (data[byte] >> offset & mask) << done;
    done += count;
  });
  return raw;
}

/// The lowest `length` bits of `raw` as a number in two's complement.
constexpr std::int64_t signed_of(std::uint64_t raw, int length) {
  const int above = 64 - length;
  return static_cast<std::int64_t>(raw << above) >> above;
}

}  // namespace epiline::can
