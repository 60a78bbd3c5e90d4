#pragma once
// An estimate in CAN frames. Nothing here allocates, waits or throws. Page: docs/can.md.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/links/can/messages.h"
#include "estimator/geometry/types.h"
#include "platform/memory/fixed_vector.h"
#include "platform/samples/samples.h"

namespace epiline::can {

struct Frame {
  std::uint16_t id = 0;
  std::uint8_t size = 0;  ///< bytes; more than 8: a frame of CAN FD
  std::array<std::uint8_t, kFdBytes> data{};
  bool is_fd() const { return size > kClassicBytes; }
};

inline constexpr std::size_t kMostFrames = kClassicOdometry.size() + kDeviations.size();  ///< of one epoch
using Frames = FixedVector<Frame, kMostFrames>;

/// CRC-8 of SAE J1850 over identifier and bytes 1 to the last.
std::uint8_t crc_of(std::uint16_t id, std::span<const std::uint8_t> data) noexcept;

/// What a status says of an estimate.
Values values_of(const Health& health, std::uint8_t reset_counter) noexcept;

/// What an epoch says of an estimate, in the vehicle's axes: forward, left, up. `R_VB` turns vectors of the IMU's axes
/// into these. `reset_counter` is the sender's, not that of the estimate. `now`: for the age.
Values values_of(const Odometry& odometry, const Mat3& R_VB, std::uint8_t reset_counter, HostStamp now) noexcept;

/// The number of kStateNames that says that nothing comes from the estimator.
inline constexpr int kSilent = static_cast<int>(kStateNames.size()) - 1;

/// Numbers frames: each identifier has a counter of its own, the frames of one instant share another.
class FrameWriter {
 public:
  FrameWriter(int base_id, bool fd) : base_id_(base_id), fd_(fd) {}

  /// The frames of the next epoch, with standard deviations or without.
  Frames odometry(Values values, bool deviations) noexcept;
  /// Has the number of the last epoch.
  Frame status(Values values) noexcept;

 private:
  Frame pack(const Message& message, Values& values) noexcept;

  int base_id_;
  bool fd_;
  std::uint8_t epoch_ = 0;
  std::array<std::uint8_t, kMessages.size()> alive_{};
};

}  // namespace epiline::can
