#pragma once
// A camera with a V4L2 driver. Images stay in the driver's buffers if their format allows. docs/camera.md.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "drivers/sensors/camera/camera_clock.h"
#include "drivers/sensors/camera/camera_exposure.h"
#include "drivers/sensors/camera/control_requests.h"
#include "drivers/sensors/camera/driver_stamps.h"
#include "drivers/sensors/camera/grey_copies.h"
#include "drivers/sensors/camera/stamp_line.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "platform/concurrency/snapshot.h"
#include "platform/linux/system_calls.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"

namespace epiline {

/// Counters of images and of the device.
struct CameraCounts {
  std::uint64_t frames = 0;         ///< images delivered
  std::uint64_t lost = 0;           ///< gaps of the driver's sequence numbers
  std::uint64_t damaged = 0;        ///< marked as damaged by the driver, or no whole JPEG
  std::uint64_t incomplete = 0;     ///< shorter than an image
  std::uint64_t bad_stamps = 0;     ///< unknown clock, or not credible after the previous ones
  std::uint64_t no_edge = 0;        ///< with a stamp line: the image's edge was uncertain
  std::uint64_t without_clock = 0;  ///< with the camera's own clock: stamped by the driver's, less its usual lag
  std::uint64_t bad_metadata = 0;   ///< metadata of an image that make no sense
  std::uint64_t no_slot = 0;        ///< all images were lent
  std::uint64_t overwritten = 0;    ///< the driver reused a buffer that was lent
  std::uint64_t disconnected = 0;   ///< the device was lost
  std::uint64_t retries = 0;        ///< failed attempts to reopen it
  std::uint64_t other_camera = 0;   ///< of those: another camera was in its place
  int last_error = 0;               ///< errno of the last loss or failed attempt; 0: it was silent, or not as before
};
inline constexpr auto kCameraCounters = std::to_array<Counter<CameraCounts>>({
    {"images", &CameraCounts::frames},
    {"lost", &CameraCounts::lost, true},
    {"damaged", &CameraCounts::damaged, true},
    {"incomplete", &CameraCounts::incomplete, true},
    {"bad_stamps", &CameraCounts::bad_stamps, true},
    {"no_edge", &CameraCounts::no_edge},
    {"without_clock", &CameraCounts::without_clock, true},
    {"bad_metadata", &CameraCounts::bad_metadata, true},
    {"no_slot", &CameraCounts::no_slot, true},
    {"overwritten", &CameraCounts::overwritten, true},
    {"disconnected", &CameraCounts::disconnected, true},
    {"retries", &CameraCounts::retries},
    {"other_camera", &CameraCounts::other_camera, true},
});

/// One thread calls open(), read() and close(); any thread may call give_back() and counts(). After open() there is no
/// heap call, also while the device is lost; a read() that reopens it takes as long as the kernel needs.
class V4l2Camera final : public CameraSource {
 public:
  explicit V4l2Camera(V4l2Settings settings, SystemCalls& system = SystemCalls::of_this_computer());
  ~V4l2Camera() override { close(); }

  /// The error names the fault of the device or the settings.
  Status open() override;
  void close() noexcept override;
  /// An image that was lent when the device was lost can still be read until it is given back.
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  void give_back(const Frame& frame) noexcept override;

  /// As the device was set by open().
  const DeviceFormat& format() const noexcept { return format_; }
  bool copies() const noexcept { return copies_; }
  const BufferReading& reading() const noexcept { return reading_; }
  Focus focus() const noexcept { return focus_.load(std::memory_order_relaxed); }  ///< when it was set up
  Span exposure() const noexcept { return exposure_.report().time; }               ///< of the newest image
  ExposureReport exposure_report() const noexcept { return exposure_.report(); }
  CameraCounts counts() const noexcept { return shown_counts_.read(); }
  /// Timestamps are those of the camera's own clock, see clock_state().
  bool has_own_clock() const noexcept { return clock_.is_used(); }
  ClockState clock_state() const noexcept { return clock_.state(); }
  /// Of the stamp line, if there is one.
  EdgeCounts edge_counts() const noexcept { return stamp_line_.counts(); }
  GpioCounts line_counts() const noexcept { return stamp_line_.line_counts(); }
  bool is_streaming() const noexcept { return streaming_.load(std::memory_order_relaxed); }

  // While it streams; any one thread.

  /// Requests to set a control, by the name that v4l2-ctl shows: one after the other, beside the images, and again when
  /// a lost device returns. False: the name is too long, or too many requests are pending.
  bool request_control(std::string_view name, std::int64_t value) noexcept { return requests_.request(name, value); }
  /// The result of the oldest request that was not reported yet. False: none.
  bool control_answer(ControlChange& answer) noexcept { return requests_.take_answer(answer); }
  /// The exposure controller; needs `exposure_control`.
  void set_automatic_exposure(bool on) noexcept { exposure_.set_automatic(on); }
  /// This camera shall be exposed as that one, which has a controller. Call before they stream; this one must outlive
  /// the leader's reads.
  void follow_exposure_of(V4l2Camera& leader) noexcept { leader.follower_ = this; }
  /// Rotation rate of the camera, rad/s: limits exposure times so that images stay sharp.
  void set_turn_rate(double rad_s) noexcept { exposure_.set_turn_rate(rad_s); }

 private:
  static constexpr std::size_t kMostBuffers = 16,
                               kSlots = 32;  ///< images lent when the device was lost keep their slots
  static constexpr unsigned kBuffersWhenCopying = 4;

  enum class SlotState : std::uint8_t {
    kFree,
    kWithDriver,
    kLent,
    kReturned,  ///< given back, not yet seen by the reading thread
  };
  struct Slot {
    DriverMemory memory;
    unsigned buffer = 0;    ///< the driver's number
    bool is_stale = false;  ///< of a stream that has ended: to be unmapped, not queued
    std::atomic<SlotState> state{SlotState::kFree};
  };

  // Setting up: open() and reopen().
  DeviceTrouble set_up() noexcept;
  DeviceTrouble find_again() noexcept;
  DeviceTrouble map_buffers() noexcept;
  void lose(int error) noexcept;
  bool reopen() noexcept;
  void tear_down() noexcept;

  // An image.
  ReadOutcome read_until(std::int64_t deadline_ns, Frame& frame) noexcept;
  bool collect_returned() noexcept;
  /// kTimeout: none is ready.
  ReadOutcome take(Frame& frame) noexcept;
  bool is_sound(const v4l2_buffer& buffer) noexcept;
  bool fill(Frame& frame, const v4l2_buffer& buffer) noexcept;
  bool stamp(Frame& frame, const v4l2_buffer& buffer) noexcept;
  int free_slot() const noexcept;
  bool is_silent(std::int64_t now_ns) const noexcept {
    return settings_.silence_most.ns > 0 && now_ns - last_image_ns_ > settings_.silence_most.ns;
  }
  bool wait(Span at_most) noexcept;

  V4l2Settings settings_;
  SystemCalls& system_;
  V4l2Device device_{system_};
  DeviceFormat format_;
  bool copies_ = false, opened_ = false;
  std::atomic<Focus> focus_{Focus::kUnknown};
  BufferReading reading_;
  DeviceIdentity identity_;  ///< of the camera that open() found
  std::uint32_t stamp_flags_ = 0;
  CameraExposure exposure_{settings_};
  V4l2Camera* follower_ = nullptr;
  ControlRequests requests_{exposure_, system_};
  WakeUp wake_up_{system_};  ///< an image was given back

  std::array<DriverMemory, kMostBuffers> buffers_{};  ///< when copying
  std::array<int, kMostBuffers> slot_of_{};           ///< when lending
  std::size_t buffer_count_ = 0;
  std::array<Slot, kSlots> slots_;
  std::vector<std::uint8_t> copies_memory_;
  GreyCopies grey_copies_{system_};

  std::atomic<bool> streaming_{false};
  std::int64_t last_image_ns_ = 0;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(1'000)};
  DriverStamps driver_stamps_;
  CameraClock clock_{settings_, system_};
  StampLine stamp_line_;

  CameraCounts counts_;
  Snapshot<CameraCounts> shown_counts_;
};

}  // namespace epiline
