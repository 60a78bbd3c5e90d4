#pragma once
// A camera with a V4L2 driver. Images stay in the driver's buffers if their format allows. docs/camera.md.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "drivers/sensors/camera/buffer_reading.h"
#include "drivers/sensors/camera/camera_clock.h"
#include "drivers/sensors/camera/camera_exposure.h"
#include "drivers/sensors/camera/control_transfers.h"
#include "drivers/sensors/camera/jpeg_decoder.h"
#include "drivers/sensors/camera/stamp_line.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "platform/concurrency/spsc_ring.h"
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

/// A request to set a control while streaming, and its result.
struct ControlChange {
  std::array<char, 48> name{};
  std::int64_t value = 0;  ///< requested value; in an answer: as read back
  bool is_set = false;     ///< false in an answer: the device refused, or has no such control
};

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
  Span exposure() const noexcept { return exposure_.report().time; }  ///< of the newest image
  ExposureReport exposure_report() const noexcept { return exposure_.report(); }
  CameraCounts counts() const noexcept;
  /// Timestamps are those of the camera's own clock, see clock_state().
  bool has_own_clock() const noexcept { return clock_.is_used(); }
  ClockState clock_state() const noexcept { return clock_.state(); }
  /// Of the stamp line, if there is one.
  EdgeCounts edge_counts() const noexcept { return stamp_line_.counts(); }
  GpioCounts line_counts() const noexcept { return stamp_line_.line_counts(); }
  bool is_streaming() const noexcept { return streaming_.load(std::memory_order_relaxed); }

  // While it streams; any one thread.

  /// Requests to set a control, by the name that v4l2-ctl shows: one after the other, beside the images, and again when
  /// a lost device returns. False: the name is too long, or kChanges requests are pending.
  bool request_control(std::string_view name, std::int64_t value) noexcept;
  /// The result of the oldest request that was not reported yet. False: none.
  bool control_answer(ControlChange& answer) noexcept { return answers_.pop(answer); }
  /// The exposure controller; needs `exposure_control`.
  void set_automatic_exposure(bool on) noexcept { exposure_.set_automatic(on); }
  /// Rotation rate of the camera, rad/s: limits exposure times so that images stay sharp.
  void set_turn_rate(double rad_s) noexcept { exposure_.set_turn_rate(rad_s); }

 private:
  static constexpr std::size_t kMostBuffers = 16,
                               kSlots = 32;  ///< images lent when the device was lost keep their slots
  static constexpr unsigned kBuffersWhenCopying = 4;
  static constexpr std::size_t kChanges = 8;

  enum class SlotState : std::uint8_t {
    kFree,
    kWithDriver,
    kLent,
    kReturned,  ///< given back, not yet seen by the reading thread
  };
  struct Memory {
    std::uint8_t* data = nullptr;
    std::size_t length = 0;
    int file = -1;  ///< of the buffer, where reading it must be announced; else -1
  };
  struct Slot {
    Memory memory;
    unsigned buffer = 0;    ///< the driver's number
    bool is_stale = false;  ///< of a stream that has ended: to be unmapped, not queued
    std::atomic<SlotState> state{SlotState::kFree};
  };
  using Counter = std::atomic<std::uint64_t>;

  // Setting up: open() and reopen().
  DeviceTrouble set_up() noexcept;
  DeviceTrouble find_again() noexcept;
  DeviceTrouble measure_reading(const DeviceFormat& format);
  DeviceTrouble map_buffers() noexcept;
  DeviceTrouble repeat_changes() noexcept;
  Error error_of(const DeviceTrouble& trouble) const;
  void lose(int error) noexcept;
  bool reopen() noexcept;
  void tear_down() noexcept;

  void begin_transfer() noexcept;
  void end_transfer() noexcept;
  void answer(const ControlJob& job) noexcept;

  // An image.
  bool collect_returned() noexcept;
  /// kTimeout: none is ready.
  ReadOutcome take(Frame& frame) noexcept;
  bool is_sound(const v4l2_buffer& buffer) noexcept;
  void announce_reading(const Memory& buffer, bool begins) const noexcept;
  bool fill(Frame& frame, const v4l2_buffer& buffer) noexcept;
  bool stamp(Frame& frame, const v4l2_buffer& buffer) noexcept;
  bool is_credible(HostStamp given, HostStamp arrival) noexcept;
  void forget_stamps() noexcept;
  void number(Frame& frame, std::uint32_t sequence) noexcept;
  int free_slot() const noexcept;
  bool is_silent(std::int64_t now_ns) const noexcept;
  bool wait(Span at_most) noexcept;

  V4l2Settings settings_;
  SystemCalls& system_;
  V4l2Device device_{system_};
  DeviceFormat format_;
  bool copies_ = false, opened_ = false;
  BufferReading reading_;
  DeviceIdentity identity_;  ///< of the camera that open() found
  std::uint32_t stamp_flags_ = 0;
  CameraExposure exposure_{settings_};
  SpscRing<ControlChange, kChanges> requests_, answers_;
  ControlTransfers transfers_{system_};
  std::optional<ControlJob> again_;               ///< a request under way when the device was lost
  std::uint64_t stream_ = 0;                      ///< counts streams
  FixedVector<ControlChange, kChanges> changes_;  ///< to be repeated when a lost device is back
  WakeUp wake_up_{system_};                       ///< an image was given back

  std::array<Memory, kMostBuffers> buffers_{};  ///< when copying
  std::array<int, kMostBuffers> slot_of_{};     ///< when lending
  std::size_t buffer_count_ = 0;
  std::array<Slot, kSlots> slots_;
  std::vector<std::uint8_t> copies_memory_;
  std::unique_ptr<JpegDecoder> jpeg_;  ///< of MJPEG

  std::atomic<bool> streaming_{false};
  std::int64_t last_image_ns_ = 0;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(1'000)};
  HostStamp last_stamp_;             ///< of the driver, believed
  HostStamp last_doubted_;           ///< and not believed
  int doubted_ = 0;                  ///< in a row
  std::optional<Span> least_delay_;  ///< from a stamp to the image's arrival; the kernel's clock: at most 0
  CameraClock clock_{settings_, system_};
  StampLine stamp_line_;
  std::uint64_t sequence_ = 0;         ///< of the newest image, ours
  std::uint32_t driver_sequence_ = 0;  ///< the driver's
  bool is_first_of_stream_ = true;

  Counter frames_{0}, lost_{0}, damaged_{0}, incomplete_{0}, bad_stamps_{0}, no_edge_{0}, no_slot_{0}, overwritten_{0},
      disconnected_{0}, retries_{0}, other_camera_{0};
  std::atomic<int> last_error_{0};
};

}  // namespace epiline
