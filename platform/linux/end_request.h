#pragma once
// How SIGINT, SIGTERM and SIGHUP end a program. A command that lives by signals waits for them (signals.h); one that
// computes looks here now and then. Two signals within a second are one wish: `timeout` sends its signal to the program
// and once more to the program's group. A later one ends the program at once.

namespace epiline {

/// While one lives, the first signal only asks, and the command writes what was done so far. Without one, a signal ends
/// the program at once, with a sentence.
class EndRequest {
 public:
  EndRequest() noexcept;
  ~EndRequest();
  EndRequest(const EndRequest&) = delete;
  EndRequest& operator=(const EndRequest&) = delete;

  /// Whether the work is to end. False without a living object. Any thread.
  static bool is_made() noexcept;
  /// "SIGTERM"; empty if there was no signal, or none that ends anything.
  static const char* signal_name() noexcept;
};

/// Begins to handle the signals. main() calls it first. SIGHUP ends nothing unless hangup_ends().
void handle_end_signals() noexcept;
/// Whether stdout was a terminal at the start, and nothing (nohup) had told the program to ignore SIGHUP: a vanished
/// terminal does not end what does not need it.
bool hangup_ends() noexcept;
/// An ending signal that was waited for, not handled.
void note_end_signal(int signal) noexcept;
/// What a signal that ends the program at once says after "ended by SIGTERM"; at most 400 bytes count.
void set_end_text(const char* text) noexcept;

}  // namespace epiline
