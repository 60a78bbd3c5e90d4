#pragma once
// Threads that play hardware.
#include <pthread.h>
#include <sched.h>

namespace epiline {

/// Hardware does not wait for programs: the calling thread goes before them.
inline void go_before_programs() {
  sched_param first{};
  first.sched_priority = 60;
  ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &first);
}

}  // namespace epiline
