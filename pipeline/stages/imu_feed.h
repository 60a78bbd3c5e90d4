#pragma once
#include "platform/samples/samples.h"

namespace epiline {

/// Which readings of the IMU a stage takes before an image: in the order they come, up to and including the first that
/// reaches the time needed. The one rule of the loop and of the threads, so that both come to the same result.
class ImuFeed {
 public:
  bool wants_more(HostStamp needed) const noexcept { return !any_ || last_ < needed; }
  void took(const ImuSample& sample) noexcept {
    any_ = true;
    gave_up_ = false;
    last_ = sample.stamp;
  }

  /// Nothing came in time; until something does.
  void give_up() noexcept { gave_up_ = true; }
  bool gave_up() const noexcept { return gave_up_; }

 private:
  bool any_ = false, gave_up_ = false;
  HostStamp last_{};
};

}  // namespace epiline
