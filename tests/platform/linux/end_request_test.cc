#include "platform/linux/end_request.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <string>

#include "platform/linux/signals.h"

namespace epiline {
namespace {

/// How a process of its own ends that does this: its exit code, or minus the signal.
template <class Do>
int end_of(Do act) {
  const pid_t child = fork();
  if (child == 0) {
    handle_end_signals();
    _exit(act());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

// `timeout` sends its signal to the program, and once more to its group.
TEST(EndRequest, TwoSignalsAtOnceAreOneWish) {
  EXPECT_EQ(end_of([] {
              const EndRequest request;
              if (EndRequest::is_made()) return 1;
              std::raise(SIGTERM);
              std::raise(SIGTERM);
              return EndRequest::is_made() && EndRequest::signal_name() == std::string("SIGTERM") ? 0 : 2;
            }),
            0);
}

TEST(EndRequest, ALaterSignalEndsTheProgram) {
  EXPECT_EQ(end_of([] {
              const EndRequest request;
              std::raise(SIGINT);
              usleep(1'100'000);
              std::raise(SIGTERM);
              return 0;
            }),
            -SIGTERM);
}

TEST(EndRequest, WithoutOneTheFirstSignalEndsTheProgram) {
  for (const int signal : {SIGINT, SIGTERM}) {
    EXPECT_EQ(end_of([signal] {
                std::raise(signal);
                return 0;
              }),
              -signal);
  }
}

TEST(EndRequest, WhatIsPendingWhenAFlightEndsTakesNothingWithIt) {
  EXPECT_EQ(end_of([] {
              {
                const EndSignals signals;
                std::raise(SIGTERM);
                if (!signals.ends(signals.wait(Span::from_milliseconds(500)))) return 1;
                for (const int signal : {SIGTERM, SIGUSR1, SIGPIPE, SIGHUP}) std::raise(signal);
              }
              std::raise(SIGTERM);
              return 0;
            }),
            0);
}

}  // namespace
}  // namespace epiline
