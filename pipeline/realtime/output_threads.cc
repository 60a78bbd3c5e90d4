// To those outside: the threads publish and log.
#include <limits>

#include "pipeline/realtime/realtime_threads.h"

namespace epiline {

void RealtimePipeline::Impl::publish_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(publish, kPoll, [&] {
      ended = has_ended(estimate);
      const Estimate* const e = newest.read();
      return ended || (e != nullptr && e->serial != last_published);
    });
    const Estimate* const e = newest.read();
    if (e != nullptr && e->serial != last_published) {
      publish_estimate(*e);
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
  if (ports.odometry != nullptr && !ports.odometry->publish(e.odometry)) bump(publish_failed);
  flight_log.published(e.serial - 1, monotonic_ns() - pace.host_of(e.odometry.stamp));
  log.parking.notify();
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
  flight_log.drain(now, last ? end_of_time : pace.stamp_of(now_ns - FlightLog::kEventWindow.ns),
                   [&](const Frame& frame) { give_back(static_cast<std::size_t>(frame.slot)); });
}

}  // namespace epiline
