#pragma once
// From images, or recorded tracks, to tracked frames.
#include <optional>
#include <span>

#include "pipeline/stages/front_end.h"
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/imu_intake.h"
#include "pipeline/stages/lent_images.h"
#include "pipeline/stages/recorded_tracks.h"
#include "platform/concurrency/parking.h"

namespace epiline {

struct TrackStageSettings {
  CameraParameters camera;
  TrackerConfig tracker;
  CameraMount mount;
  bool images = true;  ///< false: recorded tracks
  /// Recorded tracks: the points of each image, by Frame::sequence. They outlive the stage.
  std::span<const std::span<const TrackPoint>> recorded;
  Span imu_patience{};  ///< ImuIntake
  OtherLenses others{};
};

/// Tracks one image a step: as soon as the estimator has taught what it knew after the image before the previous one,
/// and the readings of the IMU up to the image have come.
class TrackStage final : public Stage {
 public:
  struct Inputs {
    FrameRing& frames;
    LentImages& images;
    const EndMark& camera_ended;
    ImuRing& imu;  ///< not read with recorded tracks
    const EndMark& imu_ended;
    KnowledgeRing& knowledge;
  };
  struct Outputs {
    TrackedRing& tracked;
    Parking& estimator;
    EventRing& events;
    LoggedImages* log = nullptr;  ///< or null
  };

  /// `known`: before any image. Throws std::invalid_argument for a tracker that cannot be built.
  TrackStage(const TrackStageSettings& settings, const Knowledge& known, const FlightClock& clock, const Inputs& in,
             const Outputs& out);

  Step step() noexcept override;
  bool ready() noexcept override;

  /// Whether images are tracked, and so the readings of the IMU wanted.
  bool wants_imu() const noexcept { return front_end_.has_value(); }
  /// Up to which reading an image would wait, by what is known now.
  HostStamp imu_needed_until(HostStamp image) const noexcept { return image + known_.imu_after_image; }
  /// After the last step: what the stage holds, or has not looked at, goes back to the camera.
  void give_back_all() noexcept;

  std::uint64_t imu_late() const noexcept { return imu_.late(); }
  const TrackerStats* tracker_stats() const noexcept { return front_end_ ? &front_end_->stats() : nullptr; }
  /// Of camera 1, 2 or 3; null without it.
  const SecondStats* other_stats(std::size_t camera) const noexcept {
    return front_end_ ? front_end_->other_stats(camera) : nullptr;
  }

 private:
  static constexpr FrameRing::Value kNone = FrameRing::kNone;

  bool lesson_is_due() const noexcept { return lessons_ + kKnowledgeDelay <= tracked_; }
  Step learn() noexcept;
  Step take_next() noexcept;
  void track(const Frame& image, const OtherFrames& others) noexcept;
  void lend_to_log(std::size_t slot) noexcept;
  void done_with_image() noexcept;
  void keep(FrameRing::Value image, FrameRing::Value& kept) noexcept;

  std::optional<FrontEnd> front_end_;
  RecordedTracks recorded_;
  std::span<const std::span<const TrackPoint>> points_;
  FlightClock clock_;
  Inputs in_;
  Outputs out_;
  ImuIntake imu_;
  Knowledge known_;
  std::uint64_t tracked_ = 0, lessons_ = 0;  ///< images; lessons taken from `knowledge`
  FrameRing::Value image_ = kNone;           ///< being tracked
  /// Of earlier images, for each camera's tracker.
  std::array<FrameRing::Value, kMostOthers + 1> kept_{kNone, kNone, kNone, kNone};
};

}  // namespace epiline
