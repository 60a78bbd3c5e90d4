#pragma once
// The stages, each carried by a thread of its own: the same stages that OfflinePipeline calls one after the other.
// docs/developers/realtime.md has the picture, the policies and the measurements.
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/predict/predictor.h"
#include "pipeline/config/calibration.h"
#include "pipeline/config/realtime_config.h"
#include "pipeline/realtime/flight_observer.h"
#include "pipeline/stages/frame_outcome.h"
#include "pipeline/stages/recorded_tracks.h"
#include "pipeline/vision/second_tracker.h"
#include "pipeline/vision/tracker.h"
#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/imu_gate.h"
#include "platform/linux/realtime.h"
#include "platform/ports/ports.h"
#include "platform/time/latency_bins.h"
#include "platform/time/monotonic.h"

namespace epiline {

struct RealtimeSettings {
  CameraParameters camera;
  TrackerConfig tracker;
  EstimatorConfig estimator;
  ImuCorrection imu_correction;
  double deadline_ms = 0;  ///< for the solve of one image; 0: as long as it takes
  RealtimeConfig realtime;
  bool images = true;  ///< false: recorded tracks
  /// Recorded tracks: the points of each image, by Frame::sequence. They outlive the pipeline.
  std::vector<std::span<const TrackPoint>> recorded;
  /// Buffers of the camera that observers may hold at a time: at least four (two for the tracker, one that is filled,
  /// one that waits) must remain. 0: they get no images.
  int images_to_log = 1;
  std::array<std::optional<CameraParameters>, kMostOthers> others{};  ///< lenses; `estimator.others` says where
};

/// What the pipeline is connected to. All outlive it; the odometry's receiver may be null.
struct RealtimePorts {
  CameraSource* camera = nullptr;
  ImuSource* imu = nullptr;
  OdometrySink* odometry = nullptr;
  std::vector<FlightObserver*> observers;
  std::vector<EventRing*> event_rings;  ///< events of threads outside the pipeline, for the observers
  // May be null; samples are used as they come, nothing waits for them.
  WheelSource* wheel = nullptr;
  HeightSource* height = nullptr;
};

/// How the run went, thread by thread and ring by ring.
struct RealtimeReport {
  struct Thread {
    const char* name = "";
    int priority = 0;  ///< as asked for
    ThreadShortfall shortfall;
    ThreadCosts costs;  ///< since arm()
    std::size_t stack_bytes = 0, stack_used = 0;
  };
  struct Ring {
    const char* name = "";
    std::size_t capacity = 0, high_water = 0;
    std::uint64_t passed = 0, dropped = 0;
  };
  std::vector<Thread> threads;
  std::vector<Ring> rings;
  std::uint64_t frames_in = 0;         ///< given by the camera
  std::uint64_t frames_overtaken = 0;  ///< of those: left out for a newer one
  std::uint64_t frames_refused = 0;    ///< of those: left out by the watch for their stamp
  ImuGateStats imu_watch;
  ImageGateStats image_watch;
  std::uint64_t frames_out = 0;  ///< of those: estimated
  std::uint64_t imu_in = 0;      ///< given by the IMU
  std::uint64_t imu_late = 0;    ///< images that did not wait any longer for their readings
  std::uint64_t wheel_in = 0;    ///< given by the wheels
  std::uint64_t height_in = 0;   ///< given by the height sensors
  std::uint64_t published = 0, publish_failed = 0;
  std::uint64_t events_dropped = 0;
  std::uint64_t images_not_logged = 0;
  std::uint64_t late = 0;  ///< images' odometry that left after the deadline
  LoadGovernor::Counts load;
  std::uint64_t predicted = 0, predict_failed = 0;  ///< odometry at the IMU's rate handed out; refused by its receiver
  PredictorStats prediction;
  LatencyBins prediction_latency;  ///< from a reading's stamp to the odometry handed out
  std::uint64_t superseded = 0;    ///< estimates that a newer one reached the publisher before
  std::string memory_not_locked;   ///< why not; empty: it is
};

class RealtimePipeline {
 public:
  /// Builds everything, starts the threads, which wait, and locks the memory. Throws std::invalid_argument for a
  /// tracker that cannot be built, std::system_error if the system has no thread left.
  RealtimePipeline(const RealtimeSettings& settings, const RealtimePorts& ports);
  /// Stops the threads if they are still running.
  ~RealtimePipeline();
  RealtimePipeline(const RealtimePipeline&) = delete;
  RealtimePipeline& operator=(const RealtimePipeline&) = delete;

  /// Lets the threads go. From now on they start no thread, use no heap and no lock, and wait
  /// nowhere but at their inputs. `pace`: where the samples' stamps lie on the computer's clock.
  void arm(const Pace& pace);

  /// True once both sources have ended and everything has gone through, or after stop().
  bool finished() const noexcept;
  /// Images estimated so far.
  std::uint64_t frames_out() const noexcept;
  /// How much has come and gone so far. From any thread.
  struct Progress {
    std::uint64_t frames_taken = 0;  ///< came and were not refused by the watch
    std::uint64_t frames_out = 0;    ///< of those: estimated
    std::uint64_t published = 0;     ///< estimates that reached the publisher, with a pose or without
    std::uint64_t imu_in = 0;        ///< readings
  };
  Progress progress() const noexcept;

  /// Tells the threads to end. From any thread.
  void stop() noexcept;
  /// Waits for the threads to end: by themselves when the sources have ended, or after stop(). Afterwards the camera
  /// has every image back.
  void join() noexcept;

  // After join().

  RealtimeReport report() const;
  const Estimator& estimator() const noexcept;
  const TrackerStats* tracker_stats() const noexcept;  ///< null with recorded tracks
  /// Of camera 1, 2 or 3; null without it, or with recorded tracks.
  const SecondStats* other_stats(std::size_t camera) const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
