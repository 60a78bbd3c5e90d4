#pragma once
// Keeps the last seconds of a flight in fixed memory, and writes them on request or when the estimate is lost, as a
// folder that a replay reads. docs/fly.md.
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/config/calibration.h"
#include "pipeline/config/realtime_config.h"
#include "pipeline/realtime/flight_observer.h"

namespace epiline {

/// Information about the run that goes into each record.
struct RecordedRun {
  CameraCalibration camera;
  std::array<std::optional<CameraCalibration>, kMostOthers> others{};  ///< of cameras 1 to 3
  double image_rate_hz = 20;
  ImuCalibration imu;
  std::string config_toml;
  /// An image as the bytes of a PNG file. Called by the recorder's thread; null: no images.
  std::string (*png)(const Frame& frame) = nullptr;
};

/// Records written and failed.
struct RecorderReport {
  std::vector<std::string> written;  ///< folders
  std::vector<std::string> failed;   ///< why, a line each
  std::uint64_t removed = 0;         ///< older records, for recorder.keep
  std::uint64_t lost = 0;            ///< samples that found no room while a record was being written
  std::size_t memory_bytes = 0;
};

/// An observer of the flight. The log thread copies samples into memory that is allocated at construction; a thread of
/// the recorder, with ordinary priority, writes the files.
class FlightRecorder final : public FlightObserver {
 public:
  /// Allocates everything and starts the writing thread. Throws std::system_error if the system cannot start a thread.
  FlightRecorder(const RecorderConfig& config, const RecordedRun& run);
  ~FlightRecorder() override;
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  /// Requests a record, from any thread or a signal handler. One request is held while a record is being written.
  void request() noexcept { requested_.store(true, std::memory_order_relaxed); }

  /// For RealtimePorts::event_rings: records written and failed.
  EventRing& events() noexcept;

  /// Call once, after the flight, when the log thread has ended. Writes a pending record or, if requested, a last one,
  /// and waits until it is written.
  void finish(bool write_the_end);
  /// After finish().
  const RecorderReport& report() const noexcept;

  void take(const FrameOutcome& outcome) noexcept override;
  void imu(const ImuSample& sample) noexcept override;
  void wheel(const WheelSample& sample) noexcept override;
  void height(const HeightSample& sample) noexcept override;
  void tracks(const LoggedTracks& tracks) noexcept override;
  void image(const Frame& frame, const OtherFrames& others) noexcept override;
  void event(const Event& event) noexcept override;
  void pass(HostStamp now) noexcept override;
  bool wants_images() const noexcept override;

 private:
  struct Impl;
  std::atomic<bool> requested_{false};
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
