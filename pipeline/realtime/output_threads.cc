// To those outside: the threads publish and log.
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
  publications.push({e.serial - 1, monotonic_ns() - pace.host_of(e.odometry.stamp)});
  log.parking.notify();
}

void RealtimePipeline::Impl::log_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(log, kPoll, [&] {
      ended = has_ended(estimate) && has_ended(publish);
      return outcomes.front() != nullptr || publications.front() != nullptr || ended;
    });
    const bool empty = outcomes.front() == nullptr && publications.front() == nullptr;
    for (const FrameOutcome* o = outcomes.front(); o != nullptr; o = outcomes.front()) {
      ports.log->take(*o);
      outcomes.pop();
    }
    for (Publication p; publications.pop(p);) ports.log->published(p.serial, p.latency_ns);
    if (empty && ended) break;
  }
  end(log, {});
}

}  // namespace epiline
