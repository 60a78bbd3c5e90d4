#pragma once
// The last seconds of a flight in fixed memory, written to disk when somebody asks or the estimate is lost, in a form
// that a replay takes. docs/flight-recorder.md.
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/config/calibration.h"
#include "pipeline/config/recorder_config.h"
#include "pipeline/realtime/flight_observer.h"

namespace epiline {

/// What a record says of the run besides its samples.
struct RecordedRun {
  CameraCalibration camera;
  double image_rate_hz = 20;
  ImuCalibration imu;
  std::string config_toml;
  /// An image as the bytes of a PNG file. Called by the recorder's thread; null: no images.
  std::string (*png)(const Frame& frame) = nullptr;
};

/// What became of the records.
struct RecorderReport {
  std::vector<std::string> written;  ///< folders
  std::vector<std::string> failed;   ///< why, a line each
  std::uint64_t lost = 0;            ///< samples that came while a record was being written and found no room
  std::size_t memory_bytes = 0;
};

/// An observer of the flight. The log thread copies what comes into memory that was allocated at construction; a thread
/// of the recorder's own, of ordinary priority, writes the files.
class FlightRecorder final : public FlightObserver {
 public:
  /// Allocates everything and starts the writing thread. Throws std::system_error if the system has no thread left.
  FlightRecorder(const RecorderConfig& config, const RecordedRun& run);
  ~FlightRecorder() override;
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  /// From any thread, or a signal handler: write what you have. While a record is being written, one more is kept in
  /// mind.
  void request() noexcept { requested_.store(true, std::memory_order_relaxed); }

  /// For RealtimePorts::event_rings: records written and failed.
  EventRing& events() noexcept;

  /// When the flight is over and the log thread has ended: writes a record that is still due or, if asked to, one of
  /// what is there; waits until all is written. Once.
  void finish(bool write_the_end);
  /// After finish().
  const RecorderReport& report() const noexcept;

  void take(const FrameOutcome& outcome) noexcept override;
  void imu(const ImuSample& sample) noexcept override;
  void wheel(const WheelSample& sample) noexcept override;
  void tracks(const LoggedTracks& tracks) noexcept override;
  void image(const Frame& frame) noexcept override;
  void event(const Event& event) noexcept override;
  void pass(HostStamp now) noexcept override;
  bool wants_images() const noexcept override;

 private:
  struct Impl;
  std::atomic<bool> requested_{false};
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
