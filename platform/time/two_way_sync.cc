#include "platform/time/two_way_sync.h"

#include <cmath>

namespace epiline {

TwoWaySync::TwoWaySync(const TwoWaySettings& settings) noexcept
    : settings_(settings), most_(settings.envelope), minus_least_(settings.envelope) {}

ClockOutcome TwoWaySync::update(HostStamp sent, DeviceStamp device, HostStamp received) noexcept {
  ++counts_.samples;
  if (!is_clock_time(sent) || !is_clock_time(device) || !is_clock_time(received) || received < sent)
    return counts_.count(ClockOutcome::kRefused);
  if (received - sent > settings_.round_trip_most) return counts_.count(ClockOutcome::kSlow);
  const Bracket bracket{device.ns, sent.ns - device.ns, received.ns - device.ns};
  std::int64_t residual = 0;
  if (!most_.empty()) {
    const Bracket model = model_at(device.ns);
    // while the skew is too large the model itself is wrong
    if (contradict(bracket, model) && !most_.too_steep()) return doubt(bracket);
    dismiss_doubt();
    if (device.ns == most_.newest_x_ns()) return counts_.count(ClockOutcome::kDuplicate);
    if (device.ns < most_.newest_x_ns()) return counts_.count(ClockOutcome::kDisordered);
    residual = (bracket.least_ns - model.least_ns + bracket.most_ns - model.most_ns) / 2;
  }
  add(bracket, residual);
  return counts_.count(ClockOutcome::kUsed);
}

bool TwoWaySync::contradict(const Bracket& a, const Bracket& b) const noexcept {
  return a.least_ns > b.most_ns + settings_.tolerance.ns || b.least_ns > a.most_ns + settings_.tolerance.ns;
}

TwoWaySync::Bracket TwoWaySync::model_at(std::int64_t x_ns) const noexcept {
  return {x_ns, -minus_least_.line().at(x_ns), most_.line().at(x_ns)};
}

void TwoWaySync::add(const Bracket& bracket, std::int64_t residual_ns) noexcept {
  most_.add(bracket.x_ns, bracket.most_ns, residual_ns);
  minus_least_.add(bracket.x_ns, -bracket.least_ns, residual_ns);
}

ClockOutcome TwoWaySync::doubt(const Bracket& bracket) noexcept {
  if (doubtful_count_ > 0) {
    const Bracket& before = doubtful_[doubtful_count_ - 1];
    if (bracket.x_ns <= before.x_ns || contradict(bracket, before)) dismiss_doubt();
  }
  doubtful_[doubtful_count_++] = bracket;
  if (doubtful_count_ < kConfirm) return ClockOutcome::kContradicts;
  most_.restart({});
  minus_least_.restart({});
  for (const Bracket& b : doubtful_) add(b, 0);
  doubtful_count_ = 0;
  return counts_.count(ClockOutcome::kJumped);
}

void TwoWaySync::dismiss_doubt() noexcept {
  counts_.outliers += doubtful_count_;
  doubtful_count_ = 0;
}

HostStamp TwoWaySync::translate(DeviceStamp device) const noexcept {
  if (most_.empty()) return {device.ns};
  const Bracket model = model_at(device.ns);
  return {device.ns + model.least_ns + (model.most_ns - model.least_ns) / 2};
}

ClockState TwoWaySync::state() const noexcept {
  ClockState state = counts_;
  if (most_.empty()) return state;
  state.status = most_.unusable() || minus_least_.unusable() ? ClockStatus::kUnusable
                 : most_.settled()                           ? ClockStatus::kLocked
                                                             : ClockStatus::kSettling;
  const Bracket model = model_at(most_.newest_x_ns());
  state.offset = {model.least_ns + (model.most_ns - model.least_ns) / 2};
  state.skew_ppm = (most_.line().slope - minus_least_.line().slope) / 2 * 1e6;
  state.bound = {std::abs(model.most_ns - model.least_ns) / 2};
  state.residual_rms = {std::llround(std::sqrt(most_.hull().mean_square_residual_ns2()))};
  state.residual_most = {most_.hull().residual_most_ns()};
  state.window = most_.span();
  return state;
}

}  // namespace epiline
