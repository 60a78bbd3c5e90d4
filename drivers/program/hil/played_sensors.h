#pragma once
// Plays a recorded flight as live sensors: each sample is stamped by this computer's clock as if it were taken now, and
// delivered when it is due, with disturbances if requested. Page: docs/hil.md.
#include <atomic>
#include <cstdint>
#include <optional>

#include "drivers/flights/motion/random.h"
#include "drivers/flights/recordings/recorded_sensors.h"

namespace epiline::hil {

/// Disturbances of samples on their way, as by a wire, a bus or a busy computer.
struct Disturbance {
  double jitter_ms = 0;  ///< largest delay of a sample, evenly distributed; the order is kept
  double loss = 0;       ///< share of samples that are lost
  bool bursts = false;   ///< samples due in the first 80 ms of a second come together at the end of the 80 ms
  double skew_ppm = 0;   ///< by how much the IMU's clock runs faster than the computer's
};

/// Decides when each sample of a source is delivered.
class Delivery {
 public:
  Delivery(const Disturbance& disturbance, std::uint64_t stream) : disturbance_(disturbance), random_(1, stream) {}
  bool loses() { return disturbance_.loss > 0 && random_.chance(disturbance_.loss); }
  /// Time of delivery of a sample that is due at `due_ns`, in a flight that began at `begin_ns`. Never decreases.
  std::int64_t instant_ns(std::int64_t due_ns, std::int64_t begin_ns);

 private:
  Disturbance disturbance_;
  Random random_;
  std::int64_t newest_ns_ = 0;
};

/// The instant at which a played flight begins. Sources wait for it.
class PlayClock {
 public:
  /// Call once. `first`: timestamp of the recording's first sample.
  void start(HostStamp first, std::int64_t host_ns) noexcept {
    pace_ = {first, host_ns, 1};
    started_.store(true, std::memory_order_release);
  }
  bool started() const noexcept { return started_.load(std::memory_order_acquire); }
  /// Valid once started() is true.
  const Pace& pace() const noexcept { return pace_; }

 private:
  Pace pace_;
  std::atomic<bool> started_{false};
};

/// The recording's images, with timestamps moved to this computer's clock.
class PlayedCamera final : public CameraSource {
 public:
  PlayedCamera(const AslDataset& dataset, const FlightPlan& plan, const PlayClock& clock,
               const Disturbance& disturbance)
      : recorded_(dataset, plan), clock_(clock), delivery_(disturbance, 1) {}
  /// A second call does nothing.
  Status open() override;
  void close() noexcept override { recorded_.close(); }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  OtherFrames others(const Frame& frame) const noexcept override;
  void give_back(const Frame& frame) noexcept override { recorded_.give_back(frame); }

  /// Images decoded too late, and an image that could not be read; see RecordedCamera.
  std::uint64_t missed() const noexcept { return recorded_.missed(); }
  const std::optional<Error>& error() const noexcept { return recorded_.error(); }

 private:
  RecordedCamera recorded_;
  const PlayClock& clock_;
  Delivery delivery_;
  bool open_ = false, started_ = false;
  std::optional<Frame> held_;  ///< not delivered yet
  std::int64_t held_until_ns_ = 0;
};

/// The recording's IMU samples.
class PlayedImu final : public ImuSource {
 public:
  PlayedImu(const AslDataset& dataset, const FlightPlan& plan, const PlayClock& clock, const Disturbance& disturbance)
      : samples_(dataset.imu_samples),
        next_(plan.first_imu),
        clock_(clock),
        delivery_(disturbance, 2),
        skew_(1e-6 * disturbance.skew_ppm) {}
  /// Ends before the first sample whose recorded timestamp is later than `last`.
  void end_after(HostStamp last) noexcept { last_ = last; }
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

 private:
  bool prepare() noexcept;

  const std::vector<ImuSample>& samples_;
  std::size_t next_;
  const PlayClock& clock_;
  Delivery delivery_;
  double skew_;
  std::optional<HostStamp> last_;
  std::optional<ImuSample> held_;
  std::int64_t held_until_ns_ = 0;
};

}  // namespace epiline::hil
