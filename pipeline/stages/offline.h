#pragma once
// The stages one after the other in the calling thread: bit-identical from run to run as long as no deadline is set.
#include <memory>

#include "pipeline/stages/back_end.h"
#include "pipeline/stages/estimator_events.h"
#include "pipeline/stages/frame_outcome.h"
#include "pipeline/stages/front_end.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/knowledge.h"
#include "pipeline/stages/recorded_tracks.h"
#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/imu_gate.h"
#include "pipeline/watch/input_events.h"
#include "platform/concurrency/spsc_ring.h"

namespace epiline {

struct OfflineSettings {
  CameraParameters camera;
  TrackerConfig tracker;
  EstimatorConfig estimator;
  double deadline_ms = 0;  ///< for the solve of one image; 0: as long as it takes
  bool images = true;      ///< false: recorded tracks
  StageClocks clocks;
};

class OfflinePipeline {
 public:
  /// Allocates everything. Throws std::invalid_argument for a tracker that cannot be built.
  explicit OfflinePipeline(const OfflineSettings& settings);

  /// Through the watch, which may correct the stamp. False: left out.
  bool add_imu(ImuSample& sample) noexcept;
  /// The same for an image, before any other use of it.
  bool admit(Frame& image) noexcept;
  /// Speeds of the wheels, in the order of time; no image waits for them.
  bool add_wheel(const WheelSample& sample) noexcept { return estimate_.add_wheel(sample); }
  /// Readings up to and including the first at or after this time must have been added before the step of an image.
  /// Each stage takes those it needs, and the others before the next image.
  HostStamp imu_needed_until(HostStamp image) const noexcept;

  void step(const Frame& image, FrameOutcome& out) noexcept;
  void step(const Frame& image, const TrackPoint* points, std::size_t count, FrameOutcome& out) noexcept;

  const Estimator& estimator() const noexcept { return estimate_.estimator(); }
  const ImuGateStats& imu_watch() const noexcept { return imu_gate_.stats(); }
  const ImageGateStats& image_watch() const noexcept { return image_gate_.stats(); }
  /// What has happened; to be emptied after each image.
  EventRing& events() noexcept { return events_; }
  const LoadGovernor::Counts& load() const noexcept { return estimate_.load(); }
  const TrackerStats* tracker_stats() const noexcept { return track_ ? &track_->stats() : nullptr; }

 private:
  using ImuRing = SpscRing<ImuSample, 256>;

  HostStamp tracker_needs(HostStamp image) const noexcept { return image + known_.imu_after_image; }
  void give(FrontEnd& stage, const ImuSample& sample) noexcept { stage.add_imu(sample); }
  void give(BackEnd& stage, const ImuSample& sample) noexcept;
  template <class Stage>
  void queue(ImuRing& ring, const ImuSample& sample, ImuFeed& feed, Stage& stage) noexcept;
  template <class Stage>
  void take_imu(ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage) noexcept;
  void estimate(FrameOutcome& out) noexcept;

  StageClocks clocks_;
  ImuGate imu_gate_;
  ImageGate image_gate_;
  std::unique_ptr<FrontEnd> track_;
  RecordedTracks recorded_;
  BackEnd estimate_;
  ImuRing imu_to_track_, imu_to_estimate_;
  ImuFeed track_feed_, estimate_feed_;
  Knowledge known_, known_next_;  ///< of this image, and of the next one
  EventRing events_;
  ImuEvents imu_events_{events_};
  ImageEvents image_events_{events_};
  EstimatorEvents estimator_events_{events_};
  std::uint64_t serial_ = 0;
  std::unique_ptr<TrackedFrame> tracked_ = std::make_unique<TrackedFrame>();
};

}  // namespace epiline
