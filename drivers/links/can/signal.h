#pragma once
// Numbers in the bits of a CAN frame, as tables. Page: docs/can.md.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/links/can/bits.h"

namespace epiline::can {

inline constexpr std::size_t kClassicBytes = 8, kFdBytes = 64;  ///< the most one frame carries

/// What a signal says.
enum class Quantity : std::uint8_t {
  kCrc,
  kEpoch,
  kAlive,
  kVersion,
  kState,
  kQuality,
  kResetCounter,
  kReasons,
  kTime,
  kAge,
  kPositionX,
  kPositionY,
  kPositionZ,
  kSmallestThreeLargest,
  kSmallestThreeA,
  kSmallestThreeB,
  kSmallestThreeC,
  kQuaternionW,
  kQuaternionX,
  kQuaternionY,
  kQuaternionZ,
  kVelocityX,
  kVelocityY,
  kVelocityZ,
  kRateX,
  kRateY,
  kRateZ,
  kPositionSdX,
  kPositionSdY,
  kPositionSdZ,
  kAttitudeSdX,
  kAttitudeSdY,
  kAttitudeSdZ,
  kVelocitySdX,
  kVelocitySdY,
  kVelocitySdZ,
  kCount,
};
inline constexpr std::size_t kQuantities = static_cast<std::size_t>(Quantity::kCount);
constexpr Quantity after(Quantity first, std::size_t by) {
  return static_cast<Quantity>(static_cast<std::size_t>(first) + by);
}

/// One number for each quantity, in its signal's unit. Not a number: not available.
class Values {
 public:
  constexpr double& operator[](Quantity q) { return values_[static_cast<std::size_t>(q)]; }
  constexpr double operator[](Quantity q) const { return values_[static_cast<std::size_t>(q)]; }

 private:
  std::array<double, kQuantities> values_{};
};

enum class Coding : std::uint8_t {
  kUnsigned,  ///< all bits set: not available
  kSigned,    ///< two's complement; the lowest number: not available
  kCounter,   ///< every pattern is a number; counts on from 0 after the last
};

struct Signal {
  const char* name;
  Quantity quantity;
  std::uint16_t start;  ///< bit of the lowest value; bit 0 is the lowest of byte 0 (little-endian, DBC: @1)
  std::uint8_t length;  ///< bits, 53 at most
  Coding coding;
  double scale;  ///< what 1 means
  const char* unit;
  const char* comment;

  constexpr BitField bits() const { return {start, length}; }
  constexpr bool has_gap_value() const { return coding != Coding::kCounter; }
  /// The raw number that means "not available"; of a counter, none.
  constexpr std::int64_t not_available() const {
    return coding == Coding::kSigned ? -(std::int64_t{1} << (length - 1)) : (std::int64_t{1} << length) - 1;
  }
  constexpr std::int64_t least() const { return coding == Coding::kSigned ? not_available() + 1 : 0; }
  constexpr std::int64_t most() const {
    if (coding == Coding::kSigned) return -least();
    return (std::int64_t{1} << length) - (coding == Coding::kCounter ? 1 : 2);
  }
};

struct Message {
  const char* name;
  std::uint16_t id_offset;  ///< to the first identifier
  std::uint8_t size;        ///< bytes
  const char* comment;
  std::span<const Signal> signals;
};

/// The nearest raw number. What is out of range becomes the end of the range, a counter counts round.
inline std::int64_t raw_of(const Signal& s, double value) noexcept {
  if (std::isnan(value)) return s.has_gap_value() ? s.not_available() : 0;
  const double scaled = value / s.scale;
  if (s.coding == Coding::kCounter) {
    const double turn = std::ldexp(1.0, s.length), rest = std::fmod(std::round(scaled), turn);
    return std::isfinite(rest) && rest >= 0 ? static_cast<std::int64_t>(rest) : 0;
  }
  const double low = static_cast<double>(s.least()), high = static_cast<double>(s.most());
  return std::llround(std::clamp(scaled, low, high));
}

/// No signal leaves the message or lies on another one, and all fit a double.
constexpr bool is_sound(const Message& m) {
  std::array<bool, kFdBytes * 8> taken{};
  if (m.size > kFdBytes) return false;
  for (const Signal& s : m.signals) {
    if (s.length < 1 || s.length > 53 || s.start + s.length > m.size * 8) return false;
    for (std::size_t bit = s.start; bit < static_cast<std::size_t>(s.start) + s.length; ++bit) {
      if (taken[bit]) return false;
      taken[bit] = true;
    }
  }
  return true;
}

}  // namespace epiline::can
