#pragma once
// A recorded flight as live sensors: the recording's samples, stamped by this computer's clock as if they were taken
// now, delivered when they are due, and disturbed on demand. Page: docs/hil.md.
#include <atomic>
#include <cstdint>
#include <optional>
#include <utility>

#include "drivers/flights/recordings/recorded_sensors.h"
#include "drivers/flights/simulate/random.h"
#include "drivers/program/hil/hardware_priority.h"

namespace epiline::hil {

/// What a wire, a bus or a busy computer does to samples.
struct Disturbance {
  double jitter_ms = 0;  ///< each is delivered late by up to so much, evenly spread; in their order
  double loss = 0;       ///< share of samples that do not come
  bool bursts = false;   ///< at the begin of each second nothing comes for 80 ms, then all of that at once
  double skew_ppm = 0;   ///< of the IMU: its clock runs so much faster than the computer's
};

/// When each of a source's samples is delivered.
class Delivery {
 public:
  Delivery(const Disturbance& disturbance, std::uint64_t stream) : disturbance_(disturbance), random_(1, stream) {}
  bool loses() { return disturbance_.loss > 0 && random_.chance(disturbance_.loss); }
  /// For a sample due at that instant of a flight that began at `begin_ns`; never before the sample before.
  std::int64_t instant_ns(std::int64_t due_ns, std::int64_t begin_ns);

 private:
  Disturbance disturbance_;
  Random random_;
  std::int64_t newest_ns_ = 0;
};

/// The instant at which a played flight begins; sources wait for it.
class PlayClock {
 public:
  /// Once. `first`: stamp of the recording's first sample.
  void start(HostStamp first, std::int64_t host_ns) noexcept {
    pace_ = {first, host_ns, 1};
    started_.store(true, std::memory_order_release);
  }
  bool started() const noexcept { return started_.load(std::memory_order_acquire); }
  /// After the start.
  const Pace& pace() const noexcept { return pace_; }

 private:
  Pace pace_;
  std::atomic<bool> started_{false};
};

/// The images, stamped as the recording says, on this computer's clock.
class PlayedCamera final : public CameraSource {
 public:
  PlayedCamera(const AslDataset& dataset, const FlightPlan& plan, const PlayClock& clock,
               const Disturbance& disturbance)
      : recorded_(dataset, plan), clock_(clock), delivery_(disturbance, 1) {}
  /// A second call does nothing.
  Status open() override {
    if (std::exchange(open_, true)) return Done{};
    const HardwarePriority priority;  // of the thread that decodes
    return recorded_.open();
  }
  void close() noexcept override { recorded_.close(); }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
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

/// The readings.
class PlayedImu final : public ImuSource {
 public:
  PlayedImu(const AslDataset& dataset, const FlightPlan& plan, const PlayClock& clock, const Disturbance& disturbance)
      : samples_(dataset.imu_samples),
        next_(plan.first_imu),
        end_(dataset.imu_samples.size()),
        clock_(clock),
        delivery_(disturbance, 2),
        skew_(1e-6 * disturbance.skew_ppm) {}
  /// Ends with the first reading after that stamp of the recording.
  void end_after(HostStamp last) noexcept { last_ = last; }
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

 private:
  bool prepare() noexcept;

  const std::vector<ImuSample>& samples_;
  std::size_t next_, end_;
  const PlayClock& clock_;
  Delivery delivery_;
  double skew_;
  std::optional<HostStamp> last_;
  std::optional<ImuSample> held_;
  std::int64_t held_until_ns_ = 0;
};

}  // namespace epiline::hil
