// From the devices into the rings: the threads imu and capture.
#include "pipeline/realtime/realtime_threads.h"
#include "platform/error/contract.h"

namespace epiline {

void RealtimePipeline::Impl::imu_loop() {
  std::array<ImuSample, 64> samples;
  while (!stopping()) {
    std::size_t count = 0;
    const ReadOutcome outcome = ports.imu->read(samples, count, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    if (outcome == ReadOutcome::kFailed) rest_after_failure(imu);
    if (outcome != ReadOutcome::kSample) continue;
    for (std::size_t i = 0; i < count; ++i) {
      if (track_stage) imu_to_track.push(samples[i]);  // a full ring refuses, and counts
      imu_to_estimate.push(samples[i]);
      bump(imu_in);
    }
    track.parking.notify();
    estimate.parking.notify();
  }
  end(imu, {&track, &estimate});
}

void RealtimePipeline::Impl::capture_loop() {
  while (!stopping()) {
    Frame frame;
    const ReadOutcome outcome = ports.camera->read(frame, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    if (outcome == ReadOutcome::kFailed) rest_after_failure(capture);
    if (outcome != ReadOutcome::kSample) continue;
    EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < kMostSlots, "a camera numbers its buffers from 0 to 255");
    bump(frames_in);
    slots[static_cast<std::size_t>(frame.slot)] = frame;
    const auto evicted = frames.push(static_cast<NewestRing<4>::Value>(frame.slot));
    track.parking.notify();
    if (evicted != NewestRing<4>::kNone) give_back(evicted);
  }
  end(capture, {&track});
}

}  // namespace epiline
