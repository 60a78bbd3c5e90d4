#include "pipeline/stages/capture_stage.h"

#include <cstdlib>

#include "platform/error/contract.h"

namespace epiline {

namespace {
void tell_lost(EventRing& events, HostStamp stamp, std::uint64_t first, ImageLoss why, std::uint64_t images) noexcept {
  events.push({stamp,
               EventId::kImageDropped,
               {static_cast<std::int64_t>(first), static_cast<std::int64_t>(why), static_cast<std::int64_t>(images)}});
}
}  // namespace

void leave_out_overtaken(FrameRing::Value slot, LentImages& images, EventRing& events) noexcept {
  tell_lost(events, images[slot].stamp, images[slot].sequence, ImageLoss::kOvertaken, 1);
  images.give_back(slot);
}

void CaptureStage::use() noexcept {
  EPILINE_EXPECTS(image_.slot >= 0 && image_.slot < LentImages::kMostSlots,
                  "a camera numbers its buffers from 0 to 255");
  came_.bump();
  look_for_missed();
  if (admit(image_)) {
    hand_on(image_, camera_->second(image_));
  } else {
    camera_->give_back(image_);
    refused_.bump();
  }
}

void CaptureStage::look_for_missed() noexcept {
  if (image_.sequence > expected_ && expected_ > 0)
    tell_lost(out_.events, image_.stamp, expected_, ImageLoss::kMissed, image_.sequence - expected_);
  expected_ = image_.sequence + 1;
}

bool CaptureStage::admit(Frame& image) noexcept {
  const HostStamp given = image.stamp;
  const bool taken = gate_.step(image);
  corrected_ = image.stamp - given;
  events_.after(taken, image, gate_);
  return taken;
}

Frame CaptureStage::judged(Frame second, HostStamp first) noexcept {
  if (second.data == nullptr) return second;
  const HostStamp own = second.stamp + corrected_;
  second.stamp = first;
  const bool taken = second_gate_.step(second);
  const ImageGateStats& seen = second_gate_.stats();
  second_blind_.step(seen.frozen + seen.covered, first, out_.events);
  if (apart_ == Span{}) return taken ? second : Frame{};
  second.stamp = own;
  return taken && Span{std::abs((own - first).ns)} <= apart_ ? second : Frame{};
}

void CaptureStage::hand_on(const Frame& image, const Frame& second) noexcept {
  times_.heard_image(image.arrival.ns != 0 ? image.arrival : image.stamp);
  out_.heard.tell(times_.camera, times_.camera_period);
  out_.images.lend(image, judged(second, image.stamp));
  const FrameRing::Value evicted = out_.frames.push(static_cast<FrameRing::Value>(image.slot));
  out_.tracker.notify();
  if (evicted != FrameRing::kNone) leave_out_overtaken(evicted, out_.images, out_.events);
}

}  // namespace epiline
