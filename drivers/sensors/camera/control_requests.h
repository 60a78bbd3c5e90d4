#pragma once
// Sets controls of a camera while it streams: on request, one after the other, and for the exposure controller.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/sensors/camera/camera_exposure.h"
#include "drivers/sensors/camera/control_transfers.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/system_calls.h"
#include "platform/memory/fixed_vector.h"

namespace epiline {

/// A request to set a control while streaming, and its result.
struct ControlChange {
  std::array<char, 48> name{};
  std::int64_t value = 0;  ///< requested value; in an answer: as read back
  bool is_set = false;     ///< false in an answer: the device refused, or has no such control
};

/// Called by the camera's thread, unless noted. No heap after start().
class ControlRequests {
 public:
  ControlRequests(CameraExposure& exposure, SystemCalls& system) noexcept : exposure_(exposure), transfers_(system) {}

  /// False: the system cannot start a thread.
  bool start() { return transfers_.start(); }
  void stop() noexcept;

  /// Call when a stream begins. If the device was lost before, all requested controls are set again.
  DeviceTrouble begin_stream(V4l2Device& device) noexcept;
  /// Begins the next request, or a change by the exposure controller, unless a transfer is under way.
  void begin_next(const V4l2Device& device) noexcept;
  /// Handles the end of the transfer under way, if it has ended.
  void look() noexcept;

  // Any one thread.
  /// False: the name is too long, or kMost requests are pending.
  bool request(std::string_view name, std::int64_t value) noexcept;
  /// The result of the oldest request that was not reported yet. False: none.
  bool take_answer(ControlChange& answer) noexcept { return answers_.pop(answer); }

 private:
  static constexpr std::size_t kMost = 8;

  void answer(const ControlJob& job) noexcept;

  CameraExposure& exposure_;
  ControlTransfers transfers_;
  SpscRing<ControlChange, kMost> requests_, answers_;
  std::optional<ControlJob> again_;            ///< a request under way when the device was lost
  std::uint64_t stream_ = 0;                   ///< counts streams
  FixedVector<ControlChange, kMost> changes_;  ///< to be repeated when a lost device is back
};

}  // namespace epiline
