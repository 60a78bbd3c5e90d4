// The threads of the stages: track and estimate.
#include <utility>

#include "pipeline/realtime/realtime_threads.h"
#include "platform/error/contract.h"

namespace epiline {

void RealtimePipeline::Impl::give(BackEnd& stage, const ImuSample& sample) {
  stage.add_imu(sample);
  estimator_events.after_imu(sample, stage);
}

void RealtimePipeline::Impl::imu_is_late(Worker& worker, HostStamp needed) {
  const bool tracks = &worker == &track;
  bump(tracks ? track_imu_late : estimate_imu_late);
  tell(tracks ? FlightLog::Speaker::kTrack : FlightLog::Speaker::kEstimate, needed, EventId::kImuLate,
       static_cast<std::int64_t>(settings.realtime.imu_wait_ms));
}

/// Feeds a stage with the readings that belong before an image; waits for those that have not come yet.
template <class Stage>
void RealtimePipeline::Impl::take_imu(Worker& worker, ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage) {
  // an IMU that kept one image waiting in vain and has said nothing since is not waited for again
  const Span at_most = Span::from_seconds(feed.gave_up() ? 0 : 1e-3 * settings.realtime.imu_wait_ms);
  while (feed.wants_more(needed)) {
    bool ended = false;
    const bool came = wait(worker, at_most, [&] {
      ended = has_ended(imu);  // before the look at the ring: what came before the end is found
      return ring.front() != nullptr || ended;
    });
    if (ring.front() == nullptr) {
      if (!came) imu_is_late(worker, needed);
      feed.give_up();
      return;
    }
    feed.took(*ring.front());
    give(stage, *ring.front());
    ring.pop();
  }
}

/// No image comes: the oldest readings go to the stage, which would get them anyway, before the ring is full.
template <class Stage>
void RealtimePipeline::Impl::relieve(ImuRing& ring, ImuFeed& feed, Stage& stage) {
  while (ring.published() - ring.popped() > kImuRing / 2 && ring.front() != nullptr) {
    feed.took(*ring.front());
    give(stage, *ring.front());
    ring.pop();
  }
}

void RealtimePipeline::Impl::track_loop() {
  const auto left_out = [&](NewestRing<4>::Value slot) { overtaken(slot, FlightLog::Speaker::kTrack); };
  while (!stopping()) {
    bool ended = false;
    wait(track, kPoll, [&] {
      ended = has_ended(capture);
      return frames.ready() || ended;
    });
    const auto slot = frames.pop(left_out);
    if (slot != NewestRing<4>::kNone) {
      track_frame(slots[slot]);
      // the tracker needs the pixels of the last image it was shown until the step of the next one is done
      const bool shown = !is_blind(slots[slot].reasons);
      if (!shown || previous_slot >= 0) give_back(static_cast<std::size_t>(shown ? previous_slot : slot));
      if (shown) previous_slot = slot;
    } else if (ended && !frames.ready()) {
      break;
    } else if (front_end) {
      relieve(imu_to_track, track_feed, *front_end);
    }
  }
  end(track, {&estimate, &log});
}

/// After the threads have ended: what none of them needs any more goes back to the camera.
void RealtimePipeline::Impl::give_back_rest() {
  const auto back = [&](NewestRing<4>::Value slot) { give_back(slot); };
  while (frames.ready()) back(frames.pop(back));
  if (previous_slot >= 0) give_back(static_cast<std::size_t>(std::exchange(previous_slot, -1)));
}

/// Takes over what the estimator knew after the image before the previous one: the same lesson before the same image,
/// as offline.
void RealtimePipeline::Impl::learn() {
  while (lessons + kKnowledgeDelay <= frames_tracked && !stopping()) {
    wait(track, kPoll, [&] { return knowledge.front() != nullptr; });
    lessons += knowledge.pop(known) ? 1 : 0;
  }
}

void RealtimePipeline::Impl::track_frame(const Frame& frame) {
  learn();
  if (stopping()) return;
  Tracked* const out = tracked.claim();
  EPILINE_EXPECTS(out != nullptr || stopping(), "the tracker is never more images ahead than the ring holds");
  if (out == nullptr) return;
  if (front_end) {
    take_imu(track, imu_to_track, track_feed, frame.stamp + known.imu_after_image, *front_end);
    const StageTime began = kThreadClocks.now();
    front_end->set_knowledge(Vec3(known.gyroscope_bias_rad_s.data()), known.time_offset_s);
    front_end->step(frame, out->frame);
    out->track = kThreadClocks.now() - began;
    log_image(frame);
  } else {
    const auto points = settings.recorded[frame.sequence];
    recorded.step(frame.stamp, points.data(), points.size(), out->frame);
    out->frame.reasons = frame.reasons;
    out->track = {};
  }
  out->deadline_ns = deadline_of(frame.stamp);
  tracked.publish();
  ++frames_tracked;
  estimate.parking.notify();
}

/// Lends the image to the log as well.
void RealtimePipeline::Impl::log_image(const Frame& frame) {
  if (!flight_log.wants_image()) return;
  const auto slot = static_cast<std::size_t>(frame.slot);
  loans.share(slot);
  if (!flight_log.image(frame)) give_back(slot);
}

std::int64_t RealtimePipeline::Impl::deadline_of(HostStamp image) const {
  const double ms = settings.realtime.deadline_ms;
  return ms > 0 ? pace.host_of(image) + Span::from_seconds(1e-3 * ms).ns : BackEnd::kNoDeadline;
}

void RealtimePipeline::Impl::estimate_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(estimate, kPoll, [&] {
      ended = has_ended(track);
      return tracked.front() != nullptr || ended;
    });
    if (const Tracked* const next = tracked.front()) {
      estimate_frame(*next);
      tracked.pop();
    } else if (ended) {
      break;
    } else {
      relieve(imu_to_estimate, estimate_feed, back_end);
      take_wheel();
    }
  }
  end(estimate, {&publish, &log});
}

/// Whatever has come. The estimator finds the frames it belongs to, also those before.
void RealtimePipeline::Impl::take_wheel() {
  for (WheelSample sample; wheel_to_estimate.pop(sample);) back_end.add_wheel(sample);
}

void RealtimePipeline::Impl::estimate_frame(const Tracked& image) {
  take_imu(estimate, imu_to_estimate, estimate_feed, back_end.imu_needed_until(image.frame.stamp), back_end);
  take_wheel();
  const StepResult result = back_end.step(image.frame, image.deadline_ns);
  const std::uint64_t serial = frames_out.load(std::memory_order_relaxed);
  // first whoever waits for the odometry, then the next image, then the record
  Estimate& draft = newest.draft();
  draft.serial = serial + 1;
  draft.has_pose = result.has_pose;
  draft.odometry = back_end.odometry();
  if (result.solved) {
    solved_serial = serial + 1;
    solved = draft.odometry;
  }
  draft.solved_serial = solved_serial;
  draft.solved = solved;
  newest.publish();
  publish.parking.notify();
  knowledge.push(knowledge_of(back_end));
  track.parking.notify();
  estimator_events.after_image(image.frame, back_end);
  flight_log.image_done(serial, image.frame, result, image.track, back_end);
  log.parking.notify();
  bump(frames_out);
}

}  // namespace epiline
