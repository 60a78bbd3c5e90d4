#pragma once
// Exposure of a streaming V4L2 camera: tracks which exposure each image had, and controls the next one.
#include <atomic>
#include <cstdint>
#include <optional>

#include "drivers/sensors/camera/control_transfers.h"
#include "drivers/sensors/camera/exposure_controller.h"
#include "drivers/sensors/camera/exposure_timeline.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "platform/concurrency/snapshot.h"
#include "platform/samples/samples.h"

namespace epiline {

/// For `check`, health and display.
struct ExposureReport {
  Span time;                                                 ///< of the newest image
  double gain = 1;                                           ///< likewise
  double brightness = 0, dark_share = 0, clipped_share = 0;  ///< of the newest image that was looked at
  int delay_images = 0;                                      ///< images after a change that do not show it yet
  bool is_delay_known = false;                               ///< configured, or learned
  bool is_automatic = false;
  std::uint64_t changes = 0, refused = 0;  ///< by the controller; by the device
};

/// Camera thread only, unless noted. No heap after construction.
class CameraExposure {
 public:
  explicit CameraExposure(const V4l2Settings& settings);

  /// With the device's controls as configured. Again when a lost device has come back.
  DeviceTrouble set_up(V4l2Device& device) noexcept;
  /// The change that the controller wants, if any: to be handed to ended() when it was made.
  bool next_change(ControlJob& job) noexcept;
  void ended(const ControlJob& job) noexcept;
  /// Checks whether another program changed the exposure.
  void note_changes(V4l2Device& device) noexcept;
  /// A control was changed from outside, at this time.
  void changed(std::uint32_t id, std::int64_t value, HostStamp at) noexcept;

  /// The exposure time of the next image, which has this timestamp of the V4L2 driver.
  Span time_of(HostStamp given, std::uint64_t sequence) noexcept;
  /// Passes the image of the last time_of() to the controller.
  void look(const Frame& frame) noexcept;
  /// As the device is set; images show it later.
  ExposureState setting() const noexcept;

  // Any thread.
  void set_automatic(bool on) noexcept { automatic_.store(on, std::memory_order_relaxed); }
  /// To be exposed as another camera is, in place of a controller of its own.
  void follow(const ExposureState& other) noexcept {
    followed_time_ns_.store(other.time.ns, std::memory_order_relaxed);
    followed_gain_.store(other.gain, std::memory_order_relaxed);
  }
  /// Rotation rate of the camera, rad/s, for the blur limit.
  void set_turn_rate(double rad_s) noexcept { turn_rate_.store(rad_s, std::memory_order_relaxed); }
  ExposureReport report() const noexcept;

 private:
  void look_at_other() noexcept;
  double gain_of(std::int64_t value) const noexcept;
  std::int64_t value_of_gain(double gain) const noexcept;
  std::int64_t value_of_time(Span time) const noexcept;

  const V4l2Settings& settings_;
  ExposureTimeline timeline_;
  std::optional<ExposureController> controller_;
  std::optional<ExposureState> wanted_;
  ControlFacts time_control_, gain_control_;
  std::int64_t time_value_ = 0, gain_value_ = 0;
  ExposureTimeline::OfImage of_image_;
  ExposureState asked_for_{};  ///< of the camera that is followed, the newest setting
  bool is_changing_ = false;   ///< a change is on its way to the device

  std::atomic<bool> automatic_{false};
  std::atomic<double> turn_rate_{0};
  std::atomic<std::int64_t> followed_time_ns_{0};  ///< 0: nobody is followed
  std::atomic<double> followed_gain_{1};
  ExposureReport report_;
  Snapshot<ExposureReport> shown_report_;
};

}  // namespace epiline
