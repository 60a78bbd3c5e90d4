#pragma once
// Odometry on a CAN bus, from a thread of its own. Page: docs/can.md.
#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "drivers/links/can/can_socket.h"
#include "drivers/links/can/frames.h"
#include "drivers/links/stream/odometry_stream.h"
#include "estimator/geometry/types.h"
#include "pipeline/config/devices.h"
#include "platform/concurrency/snapshot.h"
#include "platform/linux/realtime.h"
#include "platform/linux/system_calls.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"
#include "platform/time/latency_bins.h"

namespace epiline {

/// Counters of the odometry output and of the bus.
struct CanOutputCounts {
  std::uint64_t epochs = 0;         ///< odometry sent with all its frames
  std::uint64_t dropped = 0;        ///< odometry that was due while the bus was busy or gone
  std::uint64_t frames = 0;         ///< frames handed to the kernel, including status
  std::uint64_t status_frames = 0;  ///< status frames among them
  std::uint64_t queue_full = 0;     ///< attempts that found no room in the kernel's queue
  std::uint64_t frames_dropped =
      0;  ///< frames of begun epochs, given up for a newer epoch, for their age, or because of the bus
  std::uint64_t error_frames = 0, bus_off = 0, restarts = 0;
  std::uint64_t disconnected = 0;  ///< the interface went down or away
  std::uint64_t retries = 0;       ///< attempts to get it back that failed
  int last_error = 0;              ///< errno of the last loss or failed attempt
};
inline constexpr auto kCanCounters = std::to_array<Counter<CanOutputCounts>>({
    {"frames", &CanOutputCounts::frames},
    {"status_frames", &CanOutputCounts::status_frames},
    {"queue_full", &CanOutputCounts::queue_full, true},
    {"frames_dropped", &CanOutputCounts::frames_dropped},
    {"error_frames", &CanOutputCounts::error_frames},
    {"bus_off", &CanOutputCounts::bus_off, true},
    {"restarts", &CanOutputCounts::restarts},
    {"disconnected", &CanOutputCounts::disconnected, true},
    {"retries", &CanOutputCounts::retries},
});
enum class BusState : std::uint8_t { kActive, kPassive, kOff, kLost };

/// publish() is wait-free except for waking the sending thread; it may be called for every IMU sample. The thread sends
/// odometry while it is tracking or degraded, never the same or an older one again, and a status frame five times a
/// second in any case. After open() there is no heap call, no lock and no exception.
class CanOutput final : public OdometrySink {
 public:
  /// `R_VB` rotates vectors from the IMU's axes to the vehicle's (forward, left, up).
  CanOutput(CanConfig config, const Mat3& R_VB, SystemCalls& system = SystemCalls::of_this_computer());
  ~CanOutput() override { close(); }

  /// Opens the bus and starts the thread. The error names the fault of the interface or the settings.
  Status open() override;
  void close() noexcept override;
  bool publish(const Odometry& odometry) noexcept override;
  bool publish_image(const Odometry& odometry) noexcept override;

  /// For tests: open() without the thread. Then the caller does what the thread would do, turn() after turn().
  Status begin();
  /// Waits until there is something to do, at most a second, and does it.
  void turn() noexcept;

  // Any thread.

  CanOutputCounts counts() const noexcept { return told_.read(); }
  BusState bus() const noexcept { return bus_.load(std::memory_order_relaxed); }

  // After close().

  /// Latency from an image's timestamp until the kernel has the last frame of the first epoch that contains the image.
  const LatencyBins& latency() const noexcept { return stream_.latency(); }
  const ThreadCosts& costs() const noexcept { return costs_; }

 private:
  Status check_settings() const;
  static void run(void* self);
  void wait() noexcept;
  std::int64_t next_event_ns() const noexcept;
  bool stopping() const noexcept { return stop_.load(std::memory_order_acquire); }

  // The bus.
  DeviceTrouble open_socket() noexcept;
  bool is_usable(std::int64_t now_ns) noexcept;
  void lose(int error) noexcept;
  void listen(std::int64_t now_ns) noexcept;

  // What goes out.
  void note_status() noexcept;
  void begin_epoch(std::int64_t now_ns) noexcept;
  void send_pending() noexcept;
  void drop_pending() noexcept;
  void send_status(std::int64_t now_ns) noexcept;
  bool has_pending() const noexcept { return next_pending_ < pending_.size(); }
  bool hand_over(const can::Frame& frame) noexcept;

  CanConfig config_;
  Mat3 R_VB_;
  OdometryStream stream_;  ///< from the publishing thread
  SystemCalls& system_;
  WakeUp wake_up_{system_};
  can::FrameWriter writer_;
  int deviations_every_ = 1;

  // Of our thread, once it runs.
  can::CanSocket socket_{system_};
  can::Frames pending_;
  std::size_t next_pending_ = 0;
  std::uint64_t epochs_begun_ = 0;
  can::Values status_;  ///< as it is now
  std::int64_t pending_until_ns_ = 0, status_due_ns_ = 0, silent_until_ns_ = 0;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(1'000)};
  bool usable_ = true, status_wanted_ = false;
  CanOutputCounts counts_;
  std::uint64_t epochs_given_up_ = 0;
  ThreadCosts costs_;

  std::atomic<BusState> bus_{BusState::kLost};
  Snapshot<CanOutputCounts> told_;
  std::atomic<bool> stop_{false};
  RealtimeThread thread_;
};

}  // namespace epiline
