// From the devices into the rings: the threads imu, capture and wheel.
#include <utility>

#include "pipeline/realtime/realtime_threads.h"
#include "platform/error/contract.h"

namespace epiline {

void RealtimePipeline::Impl::imu_loop() {
  std::array<ImuSample, 64> samples;
  bool lost = false;
  while (!stopping()) {
    std::size_t count = 0;
    const ReadOutcome outcome = ports.imu->read(samples, count, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    note_source(outcome, lost, EventSource::kImu, FlightLog::Speaker::kImu);
    if (outcome == ReadOutcome::kFailed) rest_after_failure(imu);
    if (outcome != ReadOutcome::kSample) continue;
    for (std::size_t i = 0; i < count; ++i) {
      flight_log.imu(samples[i]);  // first: what was used is in the record
      bump(imu_in);
      const bool taken = imu_gate.step(samples[i]);
      imu_events.after(taken, samples[i], imu_gate);
      if (!taken) continue;
      imu_times.heard_imu(samples[i].arrival.ns != 0 ? samples[i].arrival : samples[i].stamp);
      if (front_end) imu_to_track.push(samples[i]);  // a full ring refuses, and counts
      imu_to_estimate.push(samples[i]);
      imu_to_publish.push(samples[i]);
    }
    heard_imu.tell(imu_times.imu, imu_times.imu_period);
    track.parking.notify();
    estimate.parking.notify();
    publish.parking.notify();
  }
  end(imu, {&track, &estimate});
}

void RealtimePipeline::Impl::capture_loop() {
  bool lost = false;
  std::uint64_t expected = 0;  // sequence number
  while (!stopping()) {
    Frame frame;
    const ReadOutcome outcome = ports.camera->read(frame, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    note_source(outcome, lost, EventSource::kCamera, FlightLog::Speaker::kCapture);
    if (outcome == ReadOutcome::kFailed) rest_after_failure(capture);
    if (outcome != ReadOutcome::kSample) continue;
    EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < kMostSlots, "a camera numbers its buffers from 0 to 255");
    bump(frames_in);
    if (frame.sequence > expected && expected > 0) {
      tell(FlightLog::Speaker::kCapture, frame.stamp, EventId::kImageDropped, static_cast<std::int64_t>(expected),
           static_cast<std::int64_t>(ImageLoss::kMissed), static_cast<std::int64_t>(frame.sequence - expected));
    }
    expected = frame.sequence + 1;
    const bool taken = image_gate.step(frame);
    image_events.after(taken, frame, image_gate);
    if (!taken) {
      ports.camera->give_back(frame);
      bump(frames_refused);
      continue;
    }
    camera_times.heard_image(frame.arrival.ns != 0 ? frame.arrival : frame.stamp);
    heard_camera.tell(camera_times.camera, camera_times.camera_period);
    slots[static_cast<std::size_t>(frame.slot)] = frame;
    loans.lend(static_cast<std::size_t>(frame.slot));
    const auto evicted = frames.push(static_cast<NewestRing<4>::Value>(frame.slot));
    track.parking.notify();
    if (evicted != NewestRing<4>::kNone) overtaken(evicted, FlightLog::Speaker::kCapture);
  }
  end(capture, {&track});
}

/// Ends with the others: a flight is not longer for its wheels.
void RealtimePipeline::Impl::wheel_loop() {
  bool lost = false;
  while (!stopping() && !(has_ended(imu) && has_ended(capture))) {
    WheelSample sample;
    const ReadOutcome outcome = ports.wheel->read(sample, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    note_source(outcome, lost, EventSource::kWheel, FlightLog::Speaker::kWheel);
    if (outcome == ReadOutcome::kFailed) rest_after_failure(wheel);
    if (outcome != ReadOutcome::kSample) continue;
    bump(wheel_in);
    wheel_to_estimate.push(sample);  // a full ring refuses, and counts
    flight_log.wheel(sample);
  }
}

void RealtimePipeline::Impl::note_source(ReadOutcome outcome, bool& lost, EventSource source,
                                         FlightLog::Speaker speaker) {
  const bool now_lost = outcome == ReadOutcome::kFailed || (lost && outcome != ReadOutcome::kSample);
  if (std::exchange(lost, now_lost) == now_lost) return;
  tell(speaker, pace.stamp_of(monotonic_ns()), now_lost ? EventId::kSourceLost : EventId::kSourceFound,
       static_cast<std::int64_t>(source));
}

/// An image that nobody will track.
void RealtimePipeline::Impl::overtaken(NewestRing<4>::Value slot, FlightLog::Speaker speaker) {
  tell(speaker, slots[slot].stamp, EventId::kImageDropped, static_cast<std::int64_t>(slots[slot].sequence),
       static_cast<std::int64_t>(ImageLoss::kOvertaken), 1);
  give_back(slot);
}

}  // namespace epiline
