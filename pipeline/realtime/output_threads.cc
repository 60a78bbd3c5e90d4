// To those outside: the threads publish and log.
#include <limits>
#include <utility>

#include "pipeline/realtime/realtime_threads.h"

namespace epiline {

void RealtimePipeline::Impl::publish_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(publish, kPoll, [&] {
      ended = has_ended(estimate);
      const Estimate* const e = newest.read();
      return ended || (e != nullptr && e->serial != last_published) || imu_to_publish.front() != nullptr;
    });
    const Estimate* const e = newest.read();
    if (e != nullptr && e->serial != last_published) {
      publish_estimate(*e);
      correct_prediction(*e);
    } else if (const ImuSample* const reading = imu_to_publish.front()) {
      publish_prediction(*reading);
      imu_to_publish.pop();
    } else if (ended) {
      break;
    }
  }
  end(publish, {&log});
}

void RealtimePipeline::Impl::publish_estimate(const Estimate& e) {
  last_published = e.serial;
  bump(published);
  if (!e.has_pose) return;
  if (ports.odometry != nullptr && !ports.odometry->publish_image(e.odometry)) bump(publish_failed);
  const std::int64_t latency_ns = monotonic_ns() - pace.host_of(e.odometry.stamp);
  if (settings.realtime.deadline_ms > 0 && 1e-6 * static_cast<double>(latency_ns) > settings.realtime.deadline_ms)
    bump(late);
  flight_log.published(e.serial - 1, latency_ns);
  log.parking.notify();
}

/// Only with what was solved: the odometry of an image in between is itself a prediction.
void RealtimePipeline::Impl::correct_prediction(const Estimate& e) {
  if (std::exchange(resets_seen, e.odometry.reset_counter) != e.odometry.reset_counter) predictor.clear();
  const bool usable = e.solved_serial != last_corrected && e.solved.reset_counter == e.odometry.reset_counter;
  last_corrected = e.solved_serial;
  if (usable) predictor.correct(e.solved);
}

void RealtimePipeline::Impl::publish_prediction(const ImuSample& reading) {
  const bool taken = predictor.add_imu(reading) == ImuHistory::Push::kTaken;
  if (!taken || predictor.state() == Predictor::State::kWaiting) return;
  const Odometry odometry = predictor.odometry();
  if (ports.odometry != nullptr && !ports.odometry->publish(odometry)) bump(predict_failed);
  prediction_latency.add(monotonic_ns() - pace.host_of(reading.stamp));
  bump(predicted);
}

void RealtimePipeline::Impl::log_loop() {
  bool over = false;
  while (!over) {
    const auto all_done = [&] { return has_ended(estimate) && has_ended(publish); };
    // not stopping(): what the others hand over before they end is still logged
    log.parking.wait_until(monotonic_ns() + kPoll.ns, [&] { return !flight_log.empty() || all_done(); });
    over = all_done();  // before the look at the rings: what came before the end is found
    log_round(over);
  }
  end(log, {});
}

void RealtimePipeline::Impl::log_round(bool last) {
  const std::int64_t now_ns = monotonic_ns();
  const HostStamp now = pace.stamp_of(now_ns), end_of_time{std::numeric_limits<std::int64_t>::max()};
  flight_log.note_lost(RingName::kImuToTrack, imu_to_track.dropped(), now);
  flight_log.note_lost(RingName::kImuToEstimate, imu_to_estimate.dropped(), now);
  flight_log.note_lost(RingName::kImuToPublish, imu_to_publish.dropped(), now);
  flight_log.drain(now, last ? end_of_time : pace.stamp_of(now_ns - FlightLog::kEventWindow.ns),
                   [&](const Frame& frame) { give_back(static_cast<std::size_t>(frame.slot)); });
}

}  // namespace epiline
