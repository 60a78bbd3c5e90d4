#pragma once
// The stages one after the other in the calling thread: bit-identical from run to run as long as no deadline is set.
#include <optional>
#include <span>
#include <vector>

#include "pipeline/stages/capture_stage.h"
#include "pipeline/stages/estimate_stage.h"
#include "pipeline/stages/imu_stage.h"
#include "pipeline/stages/track_stage.h"

namespace epiline {

struct OfflineSettings {
  CameraParameters camera;
  TrackerConfig tracker;
  EstimatorConfig estimator;
  ImuCorrection imu_correction;
  double deadline_ms = 0;  ///< for the solve of one image; 0: as long as it takes
  bool images = true;      ///< false: recorded tracks
  /// Recorded tracks: the points of each image, by Frame::sequence. They outlive the pipeline.
  std::vector<std::span<const TrackPoint>> recorded;
  StageClocks clocks;
  std::array<std::optional<CameraParameters>, kMostOthers> others{};  ///< lenses; `estimator.others` says where
  std::optional<EstimateStage::Log> log = std::nullopt;  ///< rings for what came of each image, emptied by the caller
};

class OfflinePipeline {
 public:
  /// Allocates everything. Throws std::invalid_argument for a tracker that cannot be built.
  explicit OfflinePipeline(const OfflineSettings& settings);

  /// Through the watch, which may correct the stamp. False: left out.
  bool add_imu(ImuSample& sample) noexcept;
  /// The same for an image, before any other use of it.
  bool admit(Frame& image) noexcept { return capture_.admit(image); }
  /// Speeds of the wheels, in the order of time; no image waits for them.
  void add_wheel(const WheelSample& sample) noexcept;
  /// The same for heights.
  void add_height(const HeightSample& sample) noexcept;
  /// Replaces the recorded points of an image. They stay valid until the image's step returns.
  void set_recorded(std::size_t sequence, std::span<const TrackPoint> points) noexcept { recorded_[sequence] = points; }
  /// Readings up to and including the first at or after this time must have been added before the step of an image.
  /// Each stage takes those it needs, and the others before the next image.
  HostStamp imu_needed_until(HostStamp image) const noexcept;

  /// Tracks and estimates the image. Its pixels must stay valid until the step of the next one that is not blind
  /// (is_blind) returns; its slot does not matter. `others`: as FrontEnd::step; the same holds for them.
  void step(const Frame& image, const OtherFrames& others, FrameOutcome& out) noexcept;
  void step(const Frame& image, FrameOutcome& out) noexcept { step(image, {}, out); }

  const Estimator& estimator() const noexcept { return estimate_.back_end().estimator(); }
  const ImuGateStats& imu_watch() const noexcept { return imu_.watch(); }
  const ImageGateStats& image_watch() const noexcept { return capture_.watch(); }
  /// What has happened; to be emptied after each image.
  EventRing& events() noexcept { return events_; }
  const LoadGovernor::Counts& load() const noexcept { return estimate_.back_end().load(); }
  const TrackerStats* tracker_stats() const noexcept { return track_.tracker_stats(); }
  const SecondStats* other_stats(std::size_t camera) const noexcept { return track_.other_stats(camera); }

 private:
  /// Calls the stages until none has anything to do.
  void run() noexcept;

  std::vector<std::span<const TrackPoint>> recorded_;
  Pace pace_;
  FlightClock clock_;
  EventRing events_;
  Parking nobody_;     ///< parks here
  Heard unheard_;      ///< without a publisher there are no events of silence
  EndMark imu_ended_;  ///< set: images do not wait for missing samples
  EndMark not_ended_;
  LentImages images_{nullptr};
  FrameRing frames_;
  ImuRing imu_to_track_, imu_to_estimate_;
  WheelRing speeds_;
  HeightRing heights_;
  TrackedRing tracked_;
  KnowledgeRing knowledge_;
  ImuStage imu_;
  CaptureStage capture_;
  EstimateStage estimate_;
  TrackStage track_;
};

}  // namespace epiline
