#pragma once
// Timestamps by the camera's own clock instead of the V4L2 driver's, where the settings say so. docs/camera.md
#include <cstdint>
#include <optional>

#include "drivers/sensors/camera/metadata_node.h"
#include "drivers/sensors/camera/uvc_clock.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "platform/concurrency/snapshot.h"

namespace epiline {

/// One thread, unless noted. No heap.
class CameraClock {
 public:
  CameraClock(const V4l2Settings& settings, SystemCalls& system) noexcept
      : settings_(settings), system_(system), node_(system) {}

  bool is_used() const noexcept { return settings_.uses_own_clock; }
  /// Call before each stream begins. Does nothing if the clock is not used.
  DeviceTrouble open(const V4l2Device& camera) noexcept;
  void close() noexcept { node_.close(); }

  /// Replaces the driver's timestamp `stamp` of an image by that of the camera's clock. `sequence`: the driver's number
  /// of the image. False: the new timestamp would not be later than the previous one.
  bool stamp(std::uint32_t sequence, HostStamp& stamp) noexcept;

  std::uint64_t without_clock() const noexcept { return without_clock_; }
  std::uint64_t bad_metadata() const noexcept { return bad_metadata_; }
  ClockState state() const noexcept { return shown_.read(); }  ///< any thread

 private:
  const V4l2Settings& settings_;
  SystemCalls& system_;
  MetadataNode node_;
  std::optional<UvcClock> clock_;
  HostStamp newest_;
  std::uint64_t without_clock_ = 0, bad_metadata_ = 0;
  Snapshot<ClockState> shown_;
};

}  // namespace epiline
