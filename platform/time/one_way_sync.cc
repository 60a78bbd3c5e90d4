#include "platform/time/one_way_sync.h"

#include <cmath>
#include <cstdlib>

namespace epiline {

OneWaySync::OneWaySync(const OneWaySettings& settings) noexcept : settings_(settings), envelope_(settings.envelope) {}

ClockOutcome OneWaySync::update(DeviceStamp device, HostStamp arrival) noexcept {
  ++counts_.samples;
  if (!is_clock_time(device) || !is_clock_time(arrival)) return counts_.count(ClockOutcome::kRefused);
  const std::int64_t x = device.ns, y = (arrival - settings_.min_delay).ns - device.ns;
  std::int64_t residual = 0;
  if (!envelope_.empty()) {
    residual = y - envelope_.line().at(x);
    const bool is_late = residual > settings_.late.ns;
    const bool is_early = envelope_.settled() && residual < -settings_.early.ns;
    // while the skew is too large nothing is early or late: the line itself is wrong
    if ((is_late || is_early) && !envelope_.too_steep()) return doubt(x, y, arrival, is_late);
    dismiss_doubt();
    if (x == envelope_.newest_x_ns()) return counts_.count(ClockOutcome::kDuplicate);
    if (x < envelope_.newest_x_ns()) return counts_.count(ClockOutcome::kDisordered);
  }
  envelope_.add(x, y, residual);
  return counts_.count(ClockOutcome::kUsed);
}

ClockOutcome OneWaySync::doubt(std::int64_t x_ns, std::int64_t y_ns, HostStamp arrival, bool is_late) noexcept {
  const bool agrees = !doubtful_.empty() && is_late == doubtful_late_ && x_ns > doubtful_.newest_x_ns() &&
                      (is_late || std::abs(y_ns - doubtful_y_ns_) <= settings_.late.ns);
  if (!agrees) {
    dismiss_doubt();
    doubtful_late_ = is_late;
    doubtful_y_ns_ = y_ns;
    doubtful_since_ = arrival;
  }
  doubtful_.add(x_ns, y_ns, 0);
  if (is_confirmed(x_ns, arrival)) {
    envelope_.restart(doubtful_);
    doubtful_.clear();
    return counts_.count(ClockOutcome::kJumped);
  }
  return counts_.count(is_late ? ClockOutcome::kLate : ClockOutcome::kContradicts);
}

/// Few samples ahead of the model are enough, for no delay explains them. Late ones can be a queue that is being
/// emptied: the time must pass on both clocks.
bool OneWaySync::is_confirmed(std::int64_t x_ns, HostStamp arrival) const noexcept {
  if (doubtful_.count() < settings_.early_samples) return false;
  return !doubtful_late_ || (arrival - doubtful_since_ >= settings_.late_for &&
                             x_ns - doubtful_.first_x_ns() >= settings_.late_for.ns / 2);
}

void OneWaySync::dismiss_doubt() noexcept {
  if (doubtful_.empty()) return;
  if (!doubtful_late_) counts_.outliers += doubtful_.count();
  doubtful_.clear();
}

HostStamp OneWaySync::translate(DeviceStamp device) const noexcept {
  return {device.ns + (envelope_.empty() ? 0 : envelope_.line().at(device.ns))};
}

ClockState OneWaySync::state() const noexcept {
  ClockState state = counts_;
  if (envelope_.empty()) return state;
  state.status = envelope_.unusable()  ? ClockStatus::kUnusable
                 : envelope_.settled() ? ClockStatus::kLocked
                                       : ClockStatus::kSettling;
  state.offset = {envelope_.line().at(envelope_.newest_x_ns())};
  state.skew_ppm = envelope_.line().slope * 1e6;
  state.residual_rms = {std::llround(std::sqrt(envelope_.hull().mean_square_residual_ns2()))};
  state.residual_most = {envelope_.hull().residual_most_ns()};
  state.window = envelope_.span();
  return state;
}

}  // namespace epiline
