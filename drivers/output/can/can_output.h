#pragma once
// Odometry on a CAN bus, from a thread of its own. Page: docs/can.md.
#include <atomic>
#include <cstdint>
#include <string>

#include "drivers/output/can/can_socket.h"
#include "drivers/output/can/frames.h"
#include "drivers/output/mavlink/packet.h"
#include "drivers/output/odometry_feed.h"
#include "estimator/geometry/types.h"
#include "pipeline/config/devices.h"
#include "pipeline/realtime/latency_bins.h"
#include "platform/linux/realtime.h"
#include "platform/ports/ports.h"

namespace epiline {

/// What became of odometry and of the bus.
struct CanOutputCounts {
  std::uint64_t epochs = 0;           ///< odometry sent, all its frames
  std::uint64_t frames = 0;           ///< handed to the kernel, status among them
  std::uint64_t status_frames = 0;    ///< of those
  std::uint64_t queue_full = 0;       ///< attempts that found no room in the kernel's queue
  std::uint64_t frames_dropped = 0;   ///< given up for newer ones, or with the bus
  std::uint64_t stale = 0;            ///< odometry that had waited too long
  std::uint64_t messages = 0;         ///< MAVLink frames begun by ISO-TP
  std::uint64_t messages_busy = 0;    ///< not begun: the one before was still on its way
  std::uint64_t messages_failed = 0;  ///< the peer did not answer, or the kernel refused
  std::uint64_t error_frames = 0, bus_off = 0, restarts = 0;
  std::uint64_t disconnected = 0;  ///< the interface went down or away
  std::uint64_t retries = 0;       ///< attempts to get it back that failed
  int last_error = 0;              ///< errno of the last loss or failed attempt
};
enum class BusState : std::uint8_t { kActive, kPassive, kOff, kLost };
inline constexpr const char* kBusStateNames[] = {"active", "error-passive", "bus-off", "lost"};

/// publish() is wait-free but for the waking of our thread; it may be called for every reading of the IMU. The thread
/// sends odometry as long as it is tracking or degraded, never the same or an old one again, and a status frame five
/// times a second whatever happens. After open() there is no heap call, no lock and no exception.
class CanOutput final : public OdometrySink {
 public:
  /// `R_VB` turns vectors of the IMU's axes into the vehicle's: forward, left, up.
  CanOutput(CanConfig config, const Mat3& R_VB, const ThreadSettings& thread = {"can"});
  ~CanOutput() override { close(); }

  /// Says what is wrong with the interface or the settings. Starts the thread.
  Status open() override;
  void close() noexcept override;
  bool publish(const Odometry& odometry) noexcept override;
  bool publish_image(const Odometry& odometry) noexcept override;

  // Any thread.

  CanOutputCounts counts() const noexcept;
  BusState bus() const noexcept { return bus_.load(std::memory_order_relaxed); }

  // After close().

  /// From the stamp of odometry (the reading it was predicted to), and from that of an image (to the first odometry
  /// that rests on it), to the moment the last frame of the epoch was handed to the kernel.
  const LatencyBins& latency() const noexcept { return latency_; }
  const LatencyBins& image_latency() const noexcept { return image_latency_; }
  const ThreadCosts& costs() const noexcept { return costs_; }

 private:
  using Counter = std::atomic<std::uint64_t>;

  Status check_settings() const;
  static void run(void* self);
  void loop() noexcept;
  bool stopping() const noexcept { return stop_.load(std::memory_order_acquire); }

  // The bus.
  can::OpenFault open_sockets() noexcept;
  bool is_usable(std::int64_t now_ns) noexcept;
  void lose(int error) noexcept;
  void listen(std::int64_t now_ns) noexcept;

  // What goes out.
  void take(const Offer& offer, std::int64_t now_ns) noexcept;
  void send_message(const mavlink::Odometry& message) noexcept;
  void send_pending() noexcept;
  void drop_pending() noexcept;
  void send_status(std::int64_t now_ns) noexcept;
  bool has_pending() const noexcept { return next_pending_ < pending_.size(); }
  bool hand_over(const can::Frame& frame) noexcept;
  void count_latency(std::int64_t now_ns) noexcept;

  CanConfig config_;
  Mat3 R_VB_;
  ThreadSettings thread_settings_;
  OdometryFeed feed_;
  can::FrameWriter writer_;
  int deviations_every_ = 1;

  // Of our thread, once it runs.
  can::CanSocket socket_, isotp_;
  can::Frames pending_;
  std::size_t next_pending_ = 0;
  std::uint64_t taken_ = 0, epochs_begun_ = 0;
  HostStamp sent_stamp_, pending_stamp_, pending_image_, counted_image_;
  can::Values health_;  ///< of the newest offer, for the status
  std::int64_t pending_until_ns_ = 0, status_due_ns_ = 0, retry_at_ns_ = 0, silent_until_ns_ = 0;
  Span retry_after_;
  std::uint8_t message_sequence_ = 0;
  bool status_wanted_ = false;
  LatencyBins latency_, image_latency_;
  ThreadCosts costs_;

  std::atomic<BusState> bus_{BusState::kLost};
  Counter epochs_{0}, frames_{0}, status_frames_{0}, queue_full_{0}, frames_dropped_{0}, stale_{0}, messages_{0},
      messages_busy_{0}, messages_failed_{0}, error_frames_{0}, bus_off_{0}, restarts_{0}, disconnected_{0},
      retries_{0};
  std::atomic<int> last_error_{0};

  std::atomic<bool> stop_{false};
  RealtimeThread thread_;
};

}  // namespace epiline
