#include "pipeline/stages/track_stage.h"

#include <utility>

#include "pipeline/stages/capture_stage.h"
#include "platform/error/contract.h"

namespace epiline {

TrackStage::TrackStage(const TrackStageSettings& settings, const Knowledge& known, const FlightClock& clock,
                       const Inputs& in, const Outputs& out)
    : recorded_(Camera(settings.camera)),
      points_(settings.recorded),
      clock_(clock),
      in_(in),
      out_(out),
      imu_(in.imu, in.imu_ended, settings.imu_patience, clock.clocks.wall, out.events),
      known_(known) {
  if (settings.images) front_end_.emplace(Camera(settings.camera), settings.tracker, settings.mount, settings.others);
}

bool TrackStage::ready() noexcept {
  if (lesson_is_due()) return in_.knowledge.front() != nullptr;
  if (image_ == kNone) return in_.frames.ready() || in_.camera_ended.is_set();
  return imu_.ready();
}

Step TrackStage::step() noexcept {
  if (lesson_is_due()) return learn();
  if (image_ == kNone) return take_next();
  const auto give = [&](const ImuSample& reading) { front_end_->add_imu(reading); };
  if (front_end_ && !imu_.take(give)) return Step::nothing_until(imu_.waits_until_ns());
  track(in_.images[image_], in_.images.others(image_));
  done_with_image();
  return Step::work();
}

/// The same lesson before the same image, offline and in threads.
Step TrackStage::learn() noexcept {
  if (!in_.knowledge.pop(known_)) return Step::nothing_until(clock_.now_ns() + kIdle.ns);
  ++lessons_;
  return Step::work();
}

Step TrackStage::take_next() noexcept {
  const bool over = in_.camera_ended.is_set();  // before the look at the ring: what came before the end is found
  image_ = in_.frames.pop([&](FrameRing::Value slot) { leave_out_overtaken(slot, in_.images, out_.events); });
  if (image_ != kNone) {
    imu_.begin(imu_needed_until(in_.images[image_].stamp));
    return Step::work();
  }
  if (over) return Step::end();
  if (front_end_) imu_.relieve([&](const ImuSample& reading) { front_end_->add_imu(reading); });
  return Step::nothing_until(clock_.now_ns() + kIdle.ns);
}

void TrackStage::track(const Frame& image, const OtherFrames& others) noexcept {
  Tracked* const out = out_.tracked.claim();
  EPILINE_EXPECTS(out != nullptr, "the tracker is never more images ahead than the ring holds");
  if (front_end_) {
    const StageTime began = clock_.clocks.now();
    front_end_->set_knowledge(known_);
    front_end_->step(image, others, out->frame);
    out->track = clock_.clocks.now() - began;
    lend_to_log(image_);
  } else {
    const auto points = points_[image.sequence];
    recorded_.step(image.stamp, points.data(), points.size(), out->frame);
    out->frame.reasons = image.reasons;
    out->track = {};
  }
  out_.tracked.publish();
  out_.estimator.notify();
  ++tracked_;
}

void TrackStage::lend_to_log(std::size_t slot) noexcept {
  if (out_.log == nullptr || !out_.log->wanted()) return;
  in_.images.share(slot);
  if (!out_.log->push(in_.images[slot])) in_.images.give_back(slot);
}

void TrackStage::done_with_image() noexcept {
  const FrameRing::Value image = std::exchange(image_, kNone);
  const OtherFrames& others = in_.images.others(image);
  if (!is_blind(in_.images[image].reasons)) keep(image, kept_[0]);
  for (std::size_t i = 0; i < kMostOthers; ++i)
    keep(others[i].data != nullptr && !is_blind(others[i].reasons) ? image : kNone, kept_[i + 1]);
  in_.images.give_back(image);
}

/// The tracker of a camera needs the pixels of the last image it was shown until the step of the next one is done. Of
/// another camera than the first one, a missed image ends all tracks, and older pixels are of no more use: so however
/// many cameras are lost, no more than two images are kept.
void TrackStage::keep(FrameRing::Value image, FrameRing::Value& kept) noexcept {
  if (image != kNone) in_.images.share(image);
  if (kept != kNone) in_.images.give_back(kept);
  kept = image;
}

void TrackStage::give_back_all() noexcept {
  const auto back = [&](FrameRing::Value slot) { in_.images.give_back(slot); };
  if (image_ != kNone) back(std::exchange(image_, kNone));
  for (FrameRing::Value& held : kept_)
    if (held != kNone) back(std::exchange(held, kNone));
  while (in_.frames.ready()) back(in_.frames.pop(back));
}

}  // namespace epiline
