#include "pipeline/stages/capture_stage.h"

#include <cstdlib>

#include "platform/error/contract.h"

namespace epiline {

void leave_out_overtaken(FrameRing::Value slot, LentImages& images, EventRing& events) noexcept {
  const Frame& image = images[slot];
  events.push(make_event(image.stamp, EventId::kImageDropped, image.sequence, ImageLoss::kOvertaken, 1));
  images.give_back(slot);
}

void CaptureStage::use() noexcept {
  EPILINE_EXPECTS(image_.slot >= 0 && image_.slot < LentImages::kMostSlots,
                  "a camera numbers its buffers from 0 to 255");
  came_.bump();
  look_for_missed();
  if (admit(image_)) {
    hand_on(image_, camera_->others(image_));
  } else {
    camera_->give_back(image_);
    refused_.bump();
  }
}

void CaptureStage::look_for_missed() noexcept {
  if (image_.sequence > expected_ && expected_ > 0)
    out_.events.push(
        make_event(image_.stamp, EventId::kImageDropped, expected_, ImageLoss::kMissed, image_.sequence - expected_));
  expected_ = image_.sequence + 1;
}

bool CaptureStage::admit(Frame& image) noexcept {
  const HostStamp given = image.stamp;
  const bool taken = gate_.step(image);
  corrected_ = image.stamp - given;
  events_.after(taken, image, gate_);
  return taken;
}

Frame CaptureStage::judged(std::size_t other, Frame image, HostStamp first) noexcept {
  if (image.data == nullptr) return image;
  ImageGate& gate = other_gates_[other];
  const HostStamp own = image.stamp + corrected_;
  image.stamp = first;
  const bool taken = gate.step(image);
  others_blind_[other].step(gate.stats().frozen + gate.stats().covered, first, out_.events);
  if (apart_[other] == Span{}) return taken ? image : Frame{};
  image.stamp = own;
  return taken && Span{std::abs((own - first).ns)} <= apart_[other] ? image : Frame{};
}

void CaptureStage::hand_on(const Frame& image, const OtherFrames& others) noexcept {
  times_.heard_image(image.arrival.ns != 0 ? image.arrival : image.stamp);
  out_.heard.tell(times_.camera, times_.camera_period);
  OtherFrames judged_others;
  for (std::size_t i = 0; i < kMostOthers; ++i) judged_others[i] = judged(i, others[i], image.stamp);
  out_.images.lend(image, judged_others);
  const FrameRing::Value evicted = out_.frames.push(static_cast<FrameRing::Value>(image.slot));
  out_.tracker.notify();
  if (evicted != FrameRing::kNone) leave_out_overtaken(evicted, out_.images, out_.events);
}

}  // namespace epiline
