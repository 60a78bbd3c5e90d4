#include "pipeline/stages/imu_intake.h"

namespace epiline {

void ImuIntake::begin(HostStamp needed) noexcept {
  needed_ = needed;
  begun_ = true;
  // an IMU that kept one image waiting in vain and has said nothing since is not waited for again
  patience_now_ = feed_.gave_up() ? Span{} : patience_;
  waits_until_ns_ = kNotWaiting;
}

/// The ring is empty. `over`: nothing will come.
bool ImuIntake::gives_up(bool over) noexcept {
  const std::int64_t now = now_();
  if (waits_until_ns_ == kNotWaiting) waits_until_ns_ = now + patience_now_.ns;
  if (!over && now < waits_until_ns_) return false;
  if (!over) {
    late_.bump();
    events_.push({needed_, EventId::kImuLate, {patience_.ns / 1'000'000}});
  }
  feed_.give_up();
  return true;
}

}  // namespace epiline
