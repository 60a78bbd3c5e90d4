#pragma once
// A signal in the CAN frames of another device, and the text that describes it.
#include <cstdint>
#include <string>
#include <variant>

namespace epiline {

/// Bits count as in a DBC file (can::BitField). Length 0: no signal.
struct BusSignal {
  std::uint32_t id = 0;
  bool extended = false;  ///< the identifier has 29 bits
  int start_bit = 0, length = 0;
  bool big_endian = false, is_signed = false;
  double scale = 1, offset = 0;
};

/// Whether it has 1 to 64 bits within the 64 bytes of a frame of CAN FD. Bits are counted as the signal takes them:
/// within a byte upwards if it is little-endian, else downwards.
constexpr bool fits(const BusSignal& s) noexcept {
  constexpr int kFrameBits = 512;
  if (s.length < 1 || s.length > 64 || s.start_bit < 0 || s.start_bit >= kFrameBits) return false;
  const int first = s.big_endian ? s.start_bit / 8 * 8 + 7 - s.start_bit % 8 : s.start_bit;
  return first + s.length <= kFrameBits;
}

inline constexpr const char* kBusSignalForm =
    "identifier and signal as in a DBC file, \"ID START|LENGTH@ORDER (SCALE,OFFSET)\", such as \"291 7|16@0- "
    "(0.01,0)\"";

/// Reads such a text. ORDER: 1 (little-endian) or 0 (big-endian), then + (unsigned) or -. ID: decimal or 0x; above
/// 0x7ff, or with bit 31 as DBC files write it, it has 29 bits. An empty text is no signal. Otherwise: what was
/// expected.
std::variant<BusSignal, std::string> bus_signal_from(const std::string& text);
/// The text that gives the same signal.
std::string to_text(const BusSignal& signal);

}  // namespace epiline
