#pragma once
// What the FIFOs of a BMI088 hold: data sheet BST-BMI088-DS001, sections 4.9 and 5.3 (accelerometer), 5.5 (gyroscope).
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/memory/fixed_vector.h"

namespace epiline {

using BmiVector = std::array<std::int16_t, 3>;

struct BmiAccelFrames {
  static constexpr std::size_t kMost = 160;  ///< more than the 1024 bytes of the FIFO can hold
  FixedVector<BmiVector, kMost> values;      ///< in a row up to the newest
  std::uint32_t skipped = 0;                 ///< lost before them: the FIFO was full
  bool has_time = false;
  std::uint32_t time = 0;  ///< the 24 bit counter when the FIFO had been read to its end
};

/// Frames with a header each, up to the end of the bytes, an incomplete frame, or the mark of an empty FIFO. False:
/// there was a header of no frame; `frames` has those before it.
bool parse_bmi_accel(std::span<const std::uint8_t> bytes, BmiAccelFrames& frames) noexcept;

inline constexpr std::size_t kBmiGyroFrame = 6;
/// `bytes` has at least kBmiGyroFrame.
BmiVector parse_bmi_gyro(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace epiline
