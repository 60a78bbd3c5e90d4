#pragma once
// Waits for signals instead of handling them, because a handler would run in a thread that the kernel chooses.
#include <pthread.h>
#include <unistd.h>

#include <csignal>
#include <ctime>
#include <initializer_list>

#include "platform/linux/end_request.h"
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

/// The signals that end a run in order, and SIGUSR1. What a vanished display or terminal sends does not end it: SIGPIPE
/// never does, SIGHUP only if hangup_ends().
class EndSignals : public SignalWait {
 public:
  EndSignals() : SignalWait({SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGPIPE}) {}
  /// What is pending was sent to what ends here. Delivered afterwards, it would end the program before it has written.
  ~EndSignals() {
    while (const int signal = wait({})) (void)ends(signal);
  }
  EndSignals(const EndSignals&) = delete;
  EndSignals& operator=(const EndSignals&) = delete;

  bool ends(int signal) const {
    const bool does = signal == SIGINT || signal == SIGTERM || (signal == SIGHUP && hangup_ends());
    if (does) note_end_signal(signal);
    return does;
  }
};

}  // namespace epiline
