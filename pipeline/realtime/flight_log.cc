#include "pipeline/realtime/flight_log.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace epiline {

namespace {
int wanted_images(const std::vector<FlightObserver*>& observers, int images) {
  const bool any = std::any_of(observers.begin(), observers.end(), [](const auto* o) { return o->wants_images(); });
  return any ? images : 0;
}
}  // namespace

FlightLog::FlightLog(std::vector<FlightObserver*> observers, std::vector<EventRing*> more, int images)
    : observers_(std::move(observers)), more_(std::move(more)), images_(wanted_images(observers_, images)) {}

void FlightLog::drain_samples() noexcept {
  // Only what is here now: a producer that is faster than the observers must not keep a stream for itself.
  const auto drain = [&](auto& ring, auto&& hand_on) {
    for (std::uint64_t n = ring.published() - ring.popped(); n > 0 && ring.front() != nullptr; --n) {
      for (FlightObserver* o : observers_) hand_on(*o, *ring.front());
      ring.pop();
    }
  };
  drain(imu_, [](FlightObserver& o, const ImuSample& s) { o.imu(s); });
  drain(wheel_, [](FlightObserver& o, const WheelSample& s) { o.wheel(s); });
  drain(height_, [](FlightObserver& o, const HeightSample& s) { o.height(s); });
  drain(outcomes_, [](FlightObserver& o, const FrameOutcome& f) { o.take(f); });
  drain(tracks_, [](FlightObserver& o, const LoggedTracks& t) { o.tracks(t); });
  drain(publications_, [](FlightObserver& o, const Publication& p) { o.published(p.serial, p.latency_ns); });
}

void FlightLog::drain_images(LentImages& lent) noexcept {
  for (const Frame* frame = images_.ring().front(); frame != nullptr; frame = images_.ring().front()) {
    const auto slot = static_cast<std::size_t>(frame->slot);
    for (FlightObserver* o : observers_) {
      if (o->wants_images()) o->image(*frame, lent.others(slot));
    }
    lent.give_back(slot);
    images_.ring().pop();
  }
}

void FlightLog::drain(HostStamp now, HostStamp settled, LentImages& lent) noexcept {
  drain_samples();
  drain_images(lent);
  drain_events(now, settled);
  for (FlightObserver* o : observers_) o->pass(now);
}

void FlightLog::note_lost(RingName ring, std::uint64_t dropped, HostStamp now) noexcept {
  std::uint64_t& known = lost_[static_cast<std::size_t>(ring)];
  if (dropped == known) return;
  gather(make_event(now, EventId::kRingOverflow, ring, dropped - known));
  known = dropped;
}

void FlightLog::gather(const Event& event) noexcept {
  while (!merge_.add(event)) {  // no room to wait: the earliest goes on before its time
    Event earliest;
    merge_.take(HostStamp{std::numeric_limits<std::int64_t>::max()}, earliest);
    tell(earliest);
  }
}

void FlightLog::tell(const Event& event) noexcept {
  for (FlightObserver* o : observers_) o->event(event);
}

void FlightLog::drain_events(HostStamp now, HostStamp settled) noexcept {
  each_ring([&](RingName name, const auto& ring) {
    note_lost(name, name == RingName::kImagesToLog ? images_skipped() : ring.dropped(), now);
  });
  note_lost(RingName::kEvents, events_dropped(), now);
  Event event;
  const auto take_all = [&](EventRing& ring) {
    while (ring.pop(event)) gather(event);
  };
  for (EventRing& ring : events_) take_all(ring);
  for (EventRing* ring : more_) take_all(*ring);
  while (merge_.take(settled, event)) tell(event);
}

std::uint64_t FlightLog::events_dropped() const noexcept {
  std::uint64_t dropped = 0;
  for (const EventRing& ring : events_) dropped += ring.dropped();
  for (const EventRing* ring : more_) dropped += ring->dropped();
  return dropped;
}

}  // namespace epiline
