#include "platform/linux/end_request.h"

#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstring>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

// A handler may run in any thread: all that it touches is atomic, or set before.
std::atomic<int> living{0}, asked_by{0};
std::atomic<std::int64_t> asked_at_ns{0};
char end_text[400] = "nothing was written";

const char* name_of(int signal) noexcept {
  return signal == SIGINT ? "SIGINT" : signal == SIGTERM ? "SIGTERM" : signal == SIGHUP ? "SIGHUP" : "";
}

/// Not to a terminal that is held or a pipe that is full: it would hold the end.
void say(const char* text) noexcept {
  pollfd err{STDERR_FILENO, POLLOUT, 0};
  if (poll(&err, 1, 0) == 1 && (err.revents & POLLOUT) != 0) (void)!::write(STDERR_FILENO, text, std::strlen(text));
}

void end_now(int signal, const char* how, const char* what) noexcept {
  say("epiline: error: ended by ");
  say(how);
  say(name_of(signal));
  say(", ");
  say(what);
  say("\n");
  std::signal(signal, SIG_DFL);
  std::raise(signal);  // it comes when the handler returns
}

void handle(int signal) noexcept {
  constexpr std::int64_t kSame_ns = 1'000'000'000;
  if (asked_by.load() == 0) {
    note_end_signal(signal);
    if (living.load() == 0) end_now(signal, "", end_text);
  } else if (monotonic_ns() - asked_at_ns.load() > kSame_ns) {
    end_now(signal, "a second ", living.load() > 0 ? "before all was written" : end_text);
  }
}

void on_signal(int signal, void (*handler)(int)) noexcept {
  struct sigaction action {};
  sigaction(signal, nullptr, &action);
  if (action.sa_handler == SIG_IGN) return;  // as nohup, or a shell for what runs in the background, has it
  action = {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigaction(signal, &action, nullptr);
}

}  // namespace

EndRequest::EndRequest() noexcept { living.fetch_add(1); }
EndRequest::~EndRequest() { living.fetch_sub(1); }
bool EndRequest::is_made() noexcept { return living.load() > 0 && asked_by.load() != 0; }
const char* EndRequest::signal_name() noexcept { return name_of(asked_by.load()); }

void handle_end_signals() noexcept {
  on_signal(SIGINT, handle);
  on_signal(SIGTERM, handle);
  on_signal(SIGHUP, hangup_ends() ? handle : SIG_IGN);
  on_signal(SIGUSR1, SIG_IGN);  // asks a flight for a record: it may have ended just now
}

bool hangup_ends() noexcept {
  static const bool ends = [] {
    struct sigaction action {};
    sigaction(SIGHUP, nullptr, &action);
    return action.sa_handler != SIG_IGN && isatty(STDOUT_FILENO) == 1;
  }();
  return ends;
}

void note_end_signal(int signal) noexcept {
  asked_at_ns.store(monotonic_ns());
  asked_by.store(signal);
}

void set_end_text(const char* text) noexcept { std::strncpy(end_text, text, sizeof end_text - 1); }

}  // namespace epiline
