#include "pipeline/realtime/stage_thread.h"

#include "platform/time/monotonic.h"

namespace epiline {

StageThread::StageThread(const ThreadSettings& settings, FlightSwitch& flight, AtStop at_stop)
    : settings_(settings), flight_(flight), at_stop_(at_stop) {
  flight.add(parking_);
}

bool StageThread::start(Stage& stage) {
  stage_ = &stage;
  return thread_.start(settings_, run, this);
}

void StageThread::run(void* self) noexcept {
  StageThread& thread = *static_cast<StageThread*>(self);
  const auto released = [&] { return thread.flight_.armed() || thread.flight_.stopped(); };
  while (!thread.parking_.wait_until(monotonic_ns() + Stage::kIdle.ns, released)) {
  }
  const ThreadCosts before = costs_of_this_thread();
  thread.carry();
  thread.costs_ = costs_of_this_thread() - before;
}

void StageThread::carry() noexcept {
  while (!over()) {
    const Step step = stage_->step();
    if (step.did == Step::Did::kEnd) break;
    if (step.did == Step::Did::kNothing)
      parking_.wait_until(step.sleep_until_ns, [&] { return stage_->ready() || over(); });
  }
  ended_.set();
  flight_.notify_all();
}

}  // namespace epiline
