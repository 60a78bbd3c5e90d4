#pragma once
// Odometry, transform and diagnostics for nodes of ROS 2, without ROS, from a thread of its own: docs/library.md.
#include <atomic>
#include <cstdint>
#include <optional>

#include "drivers/program/dds/participant.h"
#include "pipeline/realtime/flight_observer.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/realtime.h"
#include "platform/ports/ports.h"
#include "platform/time/latency_bins.h"

namespace epiline {

/// An instant of the monotonic clock as one of the system clock, as both are now.
HostStamp on_system_clock(HostStamp stamp) noexcept;

/// A receiver of odometry, for opening and closing, and an observer, for what it sends: the log thread hands over each
/// image's outcome, so the threads with a priority have nothing to do with it.
class DdsOutput final : public OdometrySink, public FlightObserver {
 public:
  /// What the messages' times are.
  enum class Times : std::uint8_t {
    kAsRecorded,  ///< the stamps of the samples
    kOfDay,       ///< those, which are of the monotonic clock, on the system clock: ROS 2's own
  };
  explicit DdsOutput(Times times) : times_(times) {}
  ~DdsOutput() override { DdsOutput::close(); }

  /// ErrorKind::kUsage: there is no Cyclone DDS, or ROS_DOMAIN_ID is wrong.
  Status open() override;
  /// Sends what has come before.
  void close() noexcept override;
  bool publish(const Odometry& /*odometry*/) noexcept override { return true; }

  /// Log thread. Does not wait or allocate.
  void take(const FrameOutcome& outcome) noexcept override;

  // After close().

  /// Images with a pose whose messages were written, and those left out: no room in the ring, or refused by DDS.
  std::uint64_t sent() const noexcept { return sent_; }
  std::uint64_t not_sent() const noexcept { return not_sent_ + ring_.dropped(); }
  /// From an image's stamp until its messages were written; empty with Times::kAsRecorded.
  const LatencyBins& latency() const noexcept { return latency_; }

 private:
  static void join_domain(void* self);
  static void run(void* self);
  void send(const FrameOutcome& outcome);
  bool diagnostics_are_due(const FrameOutcome& outcome) const;

  const Times times_;
  SpscRing<FrameOutcome, 64> ring_;
  Parking parking_;
  std::atomic<bool> is_open_{false};  ///< the log thread's view: released by open(), acquired by take()
  std::atomic<bool> stops_{false};    ///< released by close(), acquired by the thread
  int domain_ = 0;
  Status joined_ = Done{};  ///< by join_domain()
  RealtimeThread thread_;

  // Of the thread while it runs.
  DdsParticipant participant_;
  Health told_;                       ///< in the newest diagnostics
  std::optional<HostStamp> told_at_;  ///< none: no diagnostics were sent yet
  std::uint64_t sent_ = 0, not_sent_ = 0;
  LatencyBins latency_;
};

}  // namespace epiline
