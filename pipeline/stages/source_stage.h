#pragma once
// What the stages that read a device share.
#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_clocks.h"
#include "pipeline/watch/input_events.h"
#include "platform/ports/ports.h"

namespace epiline {

class SourceStage : public Stage {
 public:
  /// Waits for the device, kIdle at most, and uses what it gave.
  Step step() noexcept final {
    const ReadOutcome outcome = read();
    if (outcome == ReadOutcome::kEnd) return Step::end();
    source_events_.after(outcome, clock_.stamp_now());
    if (outcome == ReadOutcome::kFailed) return Step::nothing_until(clock_.now_ns() + kRest.ns);
    if (outcome == ReadOutcome::kTimeout) return Step::nothing_until(clock_.now_ns());
    use();
    return Step::work();
  }
  bool ready() noexcept final { return false; }

 protected:
  SourceStage(EventSource source, const FlightClock& clock, EventRing& events) noexcept
      : clock_(clock), source_events_(source, events) {}

 private:
  /// A lost device may fail at once, and no real-time thread may ask it all the time.
  static constexpr Span kRest = Span::from_milliseconds(10);

  virtual ReadOutcome read() noexcept = 0;
  /// After a read() that brought something.
  virtual void use() noexcept = 0;

  FlightClock clock_;
  SourceEvents source_events_;
};

}  // namespace epiline
