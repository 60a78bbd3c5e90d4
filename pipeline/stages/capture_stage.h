#pragma once
// Carries images from the camera to the tracker.
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/lent_images.h"
#include "pipeline/stages/source_stage.h"
#include "pipeline/watch/health_merge.h"
#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/input_events.h"
#include "platform/concurrency/parking.h"

namespace epiline {

/// Reports an image that will not be tracked, and returns it to the camera.
void leave_out_overtaken(FrameRing::Value slot, LentImages& images, EventRing& events) noexcept;

/// Judges every image and passes the number of its buffer to the tracker. Images that a newer one displaces from the
/// ring return to the camera.
class CaptureStage final : public SourceStage {
 public:
  struct Outputs {
    FrameRing& frames;
    LentImages& images;
    Parking& tracker;
    Heard& heard;
    EventRing& events;
  };

  /// `camera` is null where only admit() and hand_on() are called. `apart`: the images of camera 1, 2 or 3 have
  /// times of their own, which differ by no more; zero: they are taken to be of the first one's time.
  CaptureStage(CameraSource* camera, const FlightClock& clock, const Outputs& out, const OtherSpans& apart = {})
      : SourceStage(EventSource::kCamera, clock, out.events),
        camera_(camera),
        out_(out),
        apart_(apart),
        events_(out.events) {}

  /// Passes the image through the gate, which may correct its timestamp. False: drop the image.
  bool admit(Frame& image) noexcept;
  /// The image that was admitted last, with the number of its buffer, and those of other cameras, which are
  /// judged here.
  void hand_on(const Frame& image, const OtherFrames& others = {}) noexcept;

  std::uint64_t images() const noexcept { return came_.get(); }      ///< that the camera gave
  std::uint64_t refused() const noexcept { return refused_.get(); }  ///< of those: left out by the gate
  const ImageGateStats& watch() const noexcept { return gate_.stats(); }

 private:
  ReadOutcome read() noexcept override {
    image_ = {};
    return camera_->read(image_, kIdle);
  }
  void use() noexcept override;
  void look_for_missed() noexcept;
  Frame judged(std::size_t other, Frame image, HostStamp first) noexcept;

  CameraSource* camera_;
  Outputs out_;
  OtherSpans apart_;
  Span corrected_{};  ///< by the gate: what it added to the stamp of the last image
  Frame image_;
  std::uint64_t expected_ = 0;  ///< sequence number
  ImageGate gate_;
  std::array<ImageGate, kMostOthers> other_gates_;
  ImageEvents events_;
  std::array<Episode, kMostOthers> others_blind_{Episode{EventId::kOtherBlind, 1}, Episode{EventId::kOtherBlind, 2},
                                                 Episode{EventId::kOtherBlind, 3}};
  LastHeard times_;
  StageCount came_, refused_;
};

}  // namespace epiline
