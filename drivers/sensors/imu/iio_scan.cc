#include "drivers/sensors/imu/iio_scan.h"

#include <algorithm>
#include <cstring>

#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr int kMostRepeats = 16;

/// A number of at most three digits; `text` moves behind it.
bool take_number(const char*& text, int& number) noexcept {
  number = 0;
  int digits = 0;
  for (; *text >= '0' && *text <= '9' && digits < 3; ++text, ++digits) number = 10 * number + (*text - '0');
  return digits > 0;
}

bool take(const char*& text, const char* expected) noexcept {
  const std::size_t length = std::strlen(expected);
  if (std::strncmp(text, expected, length) != 0) return false;
  text += length;
  return true;
}

std::size_t length_of(const IioType& type) noexcept {
  return static_cast<std::size_t>(type.storage_bits / 8 * type.repeat);
}

std::size_t aligned(std::size_t offset, std::size_t to) noexcept { return (offset + to - 1) / to * to; }

/// The bits of a channel, as a number of 64 bits: extended by its sign, if it has one.
std::uint64_t bits_of(const std::uint8_t* bytes, const IioType& type) noexcept {
  const int count = type.storage_bits / 8;
  std::uint64_t stored = 0;
  for (int i = 0; i < count; ++i) stored = stored << 8 | bytes[type.is_big_endian ? i : count - 1 - i];
  const int above = 64 - type.bits;
  const std::uint64_t top = stored >> type.shift << above;
  // arithmetic shift of a negative number, as C++20 says
  return type.is_signed ? static_cast<std::uint64_t>(static_cast<std::int64_t>(top) >> above) : top >> above;
}

}  // namespace

bool parse_iio_type(const char* text, IioType& type) noexcept {
  type = {};
  if (take(text, "be:"))
    type.is_big_endian = true;
  else if (!take(text, "le:"))
    return false;
  if (*text != 's' && *text != 'u') return false;
  type.is_signed = *text++ == 's';
  if (!take_number(text, type.bits) || !take(text, "/") || !take_number(text, type.storage_bits)) return false;
  if (take(text, "X") && !take_number(text, type.repeat)) return false;
  if (!take(text, ">>") || !take_number(text, type.shift) || *text != '\0') return false;
  const int storage = type.storage_bits;
  return (storage == 8 || storage == 16 || storage == 32 || storage == 64) && type.bits >= 1 &&
         type.bits + type.shift <= storage && type.repeat >= 1 && type.repeat <= kMostRepeats;
}

bool IioScanLayout::add(IioChannel channel, int index, const IioType& type) noexcept {
  for (const Element& element : elements_)
    if (element.index == index) return false;
  return elements_.push_back({channel, index, type, 0});
}

bool IioScanLayout::finish() noexcept {
  std::sort(elements_.begin(), elements_.end(), [](const Element& a, const Element& b) {
    const bool a_last = a.channel == IioChannel::kTimestamp, b_last = b.channel == IioChannel::kTimestamp;
    return a_last != b_last ? b_last : a.index < b.index;
  });
  std::size_t longest = 1;
  bytes_ = 0;
  for (Element& element : elements_) {
    const std::size_t length = length_of(element.type);
    element.offset = aligned(bytes_, length);
    bytes_ = element.offset + length;
    longest = std::max(longest, length);
  }
  bytes_ = aligned(bytes_, longest);
  return !elements_.empty() && elements_.back().channel == IioChannel::kTimestamp &&
         elements_.back().type.storage_bits == 64 && elements_.back().type.repeat == 1;
}

void IioScanLayout::read(std::span<const std::uint8_t> bytes, IioScan& scan) const noexcept {
  EPILINE_EXPECTS(bytes.size() == bytes_, "a whole scan");
  for (const Element& element : elements_) {
    if (element.channel == IioChannel::kOther) continue;
    const std::uint64_t value = bits_of(bytes.data() + element.offset, element.type);
    if (element.channel == IioChannel::kTimestamp)
      scan.stamp_ns = static_cast<std::int64_t>(value);
    else
      scan.axes[static_cast<std::size_t>(element.channel)] =
          element.type.is_signed ? static_cast<double>(static_cast<std::int64_t>(value)) : static_cast<double>(value);
  }
}

}  // namespace epiline
