#include "pipeline/watch/input_events.h"

#include <cmath>
#include <utility>

namespace epiline {

namespace {
constexpr Span kQuiet = Span::from_milliseconds(500);

void tell_clock(Span& known, Span correction, EventSource source, HostStamp now, EventRing& out) {
  if (std::exchange(known, correction) == correction) return;
  out.push(make_event(now, EventId::kClockJump, source, correction.ns));
}
}  // namespace

void Episode::step(std::uint64_t counter, HostStamp now, EventRing& out) noexcept {
  const bool bad = std::exchange(known_, counter) != counter;
  if (bad) last_ = now;
  if (bad == on_ || (on_ && now - last_ < kQuiet)) return;
  on_ = bad;
  out.push(make_event(now, id_, bad, counter - before_, about_));
  if (!bad) before_ = counter;
}

void ImuEvents::after(bool taken, const ImuSample& reading, const ImuGate& gate) noexcept {
  if (taken || now_.ns == 0) now_ = reading.stamp;
  tell_clock(correction_, gate.correction(), EventSource::kImu, now_, out_);
  if (!told_bursts_ && gate.per_burst() > 0) {
    told_bursts_ = true;
    out_.push({now_, EventId::kImuInBursts, {std::lround(gate.per_burst())}});
  }
  const ImuGateStats& s = gate.stats();
  saturated_.step(s.saturated, now_, out_);
  const std::array<std::uint64_t, 5> refused = {s.out_of_order, s.duplicate, s.not_finite, s.suspect, s.impossible};
  for (std::size_t i = 0; i < refused.size(); ++i) refused_[i].step(refused[i], now_, out_);
}

void ImageEvents::after(bool taken, const Frame& image, const ImageGate& gate) noexcept {
  if (taken || now_.ns == 0) now_ = image.stamp;
  tell_clock(correction_, gate.correction(), EventSource::kCamera, now_, out_);
  frozen_.step(gate.stats().frozen, now_, out_);
  covered_.step(gate.stats().covered, now_, out_);
  repeated_.step(gate.stats().copies, now_, out_);
  const bool copy = std::exchange(copies_, gate.stats().copies) != gate.stats().copies;
  if (!taken && !copy) out_.push(make_event(now_, EventId::kImageDropped, image.sequence, ImageLoss::kRefused, 1));
}

void SourceEvents::after(ReadOutcome outcome, HostStamp now) noexcept {
  const bool lost = outcome == ReadOutcome::kFailed || (lost_ && outcome != ReadOutcome::kSample);
  if (std::exchange(lost_, lost) == lost) return;
  out_.push(make_event(now, lost ? EventId::kSourceLost : EventId::kSourceFound, source_));
}

}  // namespace epiline
