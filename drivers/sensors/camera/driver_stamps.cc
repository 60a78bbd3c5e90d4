#include "drivers/sensors/camera/driver_stamps.h"

#include <algorithm>
#include <limits>

namespace epiline {

namespace {
constexpr Span kResolution{1'000};  // of V4L2's stamps
constexpr int kBelieved = 5;        // doubtful stamps in a row
}  // namespace

void DriverStamps::restart(bool is_our_clock, HostStamp prepared, HostStamp begun) noexcept {
  prepared_ = prepared;
  begun_ = begun;
  last_ = {std::numeric_limits<std::int64_t>::min()};
  doubted_ = 0;
  least_delay_ = is_our_clock ? std::optional(Span{}) : std::nullopt;
  is_first_of_stream_ = true;
}

bool DriverStamps::is_from_before(HostStamp given) const noexcept {
  return given + kResolution > prepared_ && given <= begun_;
}

bool DriverStamps::is_credible(HostStamp given, HostStamp arrival, Span period) noexcept {
  const Span delay = arrival - given;
  const bool is_ahead = least_delay_ && delay < *least_delay_ - period;
  if (given > last_ && !is_ahead) {
    least_delay_ = least_delay_ ? std::min(*least_delay_, delay) : delay;
  } else {
    doubted_ = doubted_ > 0 && given > last_doubted_ ? doubted_ + 1 : 1;
    last_doubted_ = given;
    if (doubted_ < kBelieved) return false;
    least_delay_ = delay;
  }
  doubted_ = 0;
  last_ = given;
  return true;
}

std::uint32_t DriverStamps::count(std::uint32_t driver_sequence) noexcept {
  const std::uint32_t passed = driver_sequence - driver_sequence_;
  driver_sequence_ = driver_sequence;
  if (is_first_of_stream_) {
    sequence_ += is_first_ ? 0 : 2;  // nobody knows how many were lost between
    is_first_ = is_first_of_stream_ = false;
    return 0;
  }
  const bool has_gap = passed > 1 && passed < 0x80000000u;
  sequence_ += has_gap ? passed : 1;
  return has_gap ? passed - 1 : 0;
}

}  // namespace epiline
