#pragma once
// Waits for signals instead of handling them, because a handler would run in a thread that the kernel chooses.
#include <pthread.h>

#include <csignal>
#include <ctime>
#include <initializer_list>

#include "platform/time/clock.h"

namespace epiline {

class SignalWait {
 public:
  /// Blocks the signals in this thread and in those it starts from now on.
  SignalWait(std::initializer_list<int> signals) {
    sigemptyset(&signals_);
    for (const int s : signals) sigaddset(&signals_, s);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~SignalWait() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalWait(const SignalWait&) = delete;
  SignalWait& operator=(const SignalWait&) = delete;

  /// Sleeps for less than a second. The signal that arrived, or 0.
  int wait(Span at_most) const {
    const timespec t{0, static_cast<long>(at_most.ns)};
    const int signal = sigtimedwait(&signals_, nullptr, &t);
    return signal > 0 ? signal : 0;
  }

 private:
  sigset_t signals_, before_;
};

}  // namespace epiline
