#pragma once
// Priority for threads that stand for hardware, which a busy computer does not slow down.
#include <sched.h>

namespace epiline::hil {

/// Gives this thread the lowest real-time priority, if permitted, and so the threads that it starts during this
/// object's lifetime. That is above all ordinary threads and below everything under test.
class HardwarePriority {
 public:
  HardwarePriority() noexcept {
    const sched_param lowest{1};
    policy_ = ::sched_getscheduler(0);
    ::sched_getparam(0, &before_);
    changed_ = policy_ == SCHED_OTHER && ::sched_setscheduler(0, SCHED_FIFO, &lowest) == 0;
  }
  ~HardwarePriority() {
    if (changed_) ::sched_setscheduler(0, policy_, &before_);
  }
  HardwarePriority(const HardwarePriority&) = delete;
  HardwarePriority& operator=(const HardwarePriority&) = delete;

 private:
  int policy_ = SCHED_OTHER;
  sched_param before_{};
  bool changed_ = false;
};

}  // namespace epiline::hil
