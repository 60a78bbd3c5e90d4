#pragma once
// The bytes of Linux' IIO buffers: how channels lie in a scan, and what a scan says.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/memory/fixed_vector.h"

namespace epiline {

/// How one channel is stored, as its attribute `type` says: "le:s12/16X1>>4" is little-endian, signed, 12 bits in 16,
/// once, shifted up by 4.
struct IioType {
  bool is_big_endian = false, is_signed = false;
  int bits = 0, storage_bits = 0, repeat = 1, shift = 0;
  bool operator==(const IioType&) const = default;
};
/// False: not of that form, or senseless.
bool parse_iio_type(const char* text, IioType& type) noexcept;

enum class IioChannel : std::uint8_t {
  kGyroscopeX,
  kGyroscopeY,
  kGyroscopeZ,
  kAccelerometerX,
  kAccelerometerY,
  kAccelerometerZ,
  kTimestamp,
  kOther,  ///< takes room, not used
};
inline constexpr std::size_t kIioAxes = 6;

/// What a scan holds, as counts of the device. Axes that are not in it stay as they are.
struct IioScan {
  std::array<double, kIioAxes> axes{};
  std::int64_t stamp_ns = 0;
};

/// The layout of a scan: enabled channels in the order of their index, the time stamp last, each aligned to its own
/// length, the whole to the longest.
class IioScanLayout {
 public:
  static constexpr std::size_t kMostElements = 32;
  static constexpr std::size_t kMostBytes = 2 * kMostElements * 8 * 16;  ///< of a scan, gaps included

  void clear() noexcept { *this = {}; }
  /// In any order. False: there is no room, or two have the same index.
  bool add(IioChannel channel, int index, const IioType& type) noexcept;
  /// Once all are added. False: no time stamp, or it is not 64 bits.
  bool finish() noexcept;

  std::size_t bytes() const noexcept { return bytes_; }  ///< of a scan
  /// `bytes` are bytes() of them.
  void read(std::span<const std::uint8_t> bytes, IioScan& scan) const noexcept;

 private:
  struct Element {
    IioChannel channel = IioChannel::kOther;
    int index = 0;
    IioType type;
    std::size_t offset = 0;
  };
  FixedVector<Element, kMostElements> elements_;
  std::size_t bytes_ = 0;
};

}  // namespace epiline
