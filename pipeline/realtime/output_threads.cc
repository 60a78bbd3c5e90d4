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
      if (!e->has_pose) publish_silence();  // images may come on while the IMU is silent. Last: it reads `newest` anew
    } else if (const ImuSample* const reading = imu_to_publish.front()) {
      publish_prediction(*reading);
      imu_to_publish.pop();
    } else if (ended) {
      break;
    } else {
      publish_silence();
    }
  }
  end(publish, {&log});
}

/// The verdict of the last image, and what its sensors have done since.
Health RealtimePipeline::Impl::health_now(const Health& health) const {
  if (has_ended(capture) || has_ended(imu)) return health;  // a recording that is over is no silence
  const auto last = [](const Heard& heard) { return HostStamp{heard.last_ns.load(std::memory_order_relaxed)}; };
  const auto period = [](const Heard& heard) { return Span{heard.period_ns.load(std::memory_order_relaxed)}; };
  const LastHeard heard{last(heard_camera), last(heard_imu), period(heard_camera), period(heard_imu)};
  return with_silence(health, heard, pace.stamp_of(monotonic_ns()));
}

/// Nothing new: if a sensor is the reason, the last prediction goes out again with the health of now. Nobody else would
/// say.
void RealtimePipeline::Impl::publish_silence() {
  if (ports.odometry == nullptr || predictor.state() == Predictor::State::kWaiting) return;
  const Odometry odometry = prediction_now();
  const std::uint32_t silent = bit(HealthReason::kCameraSilent) | bit(HealthReason::kImuSilent);
  if ((odometry.health.reasons & silent) != 0 && !ports.odometry->publish(odometry)) bump(predict_failed);
}

void RealtimePipeline::Impl::publish_estimate(const Estimate& e) {
  last_published = e.serial;
  bump(published);
  if (!e.has_pose) return;
  if (ports.odometry != nullptr) {
    Odometry odometry = e.odometry;
    odometry.health = health_now(e.odometry.health);
    if (!ports.odometry->publish_image(odometry)) bump(publish_failed);
  }
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

/// The prediction with the health of now: the verdict on the last image may be worse than that on the last solve.
Odometry RealtimePipeline::Impl::prediction_now() {
  Odometry odometry = predictor.odometry();
  const Estimate* const e = newest.read();
  const bool current = predictor.state() == Predictor::State::kCurrent;
  odometry.health = health_now(current && e != nullptr ? e->odometry.health : odometry.health);
  return odometry;
}

void RealtimePipeline::Impl::publish_prediction(const ImuSample& reading) {
  const bool taken = predictor.add_imu(reading) == ImuHistory::Push::kTaken;
  if (!taken || predictor.state() == Predictor::State::kWaiting) return;
  const Odometry odometry = prediction_now();
  if (ports.odometry != nullptr && !ports.odometry->publish(odometry)) bump(predict_failed);
  prediction_latency.add(monotonic_ns() - pace.host_of(reading.stamp));
  bump(predicted);
}

void RealtimePipeline::Impl::log_loop() {
  bool over = false;
  while (!over) {
    const auto all_done = [&] { return has_ended(track) && has_ended(estimate) && has_ended(publish); };
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
  flight_log.note_lost(RingName::kWheelToEstimate, wheel_to_estimate.dropped(), now);
  flight_log.drain(now, last ? end_of_time : pace.stamp_of(now_ns - FlightLog::kEventWindow.ns),
                   [&](const Frame& frame) { give_back(static_cast<std::size_t>(frame.slot)); });
}

}  // namespace epiline
