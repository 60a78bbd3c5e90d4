#pragma once
// Reports to the service manager (sd_notify(3)): one datagram per message, to the socket in NOTIFY_SOCKET.
#include <cstdint>
#include <string>
#include <string_view>

#include "platform/time/clock.h"

namespace epiline {

/// Does nothing without NOTIFY_SOCKET. One thread.
class ServiceManager {
 public:
  /// Takes the socket's name from NOTIFY_SOCKET, the watchdog's time from WATCHDOG_USEC unless WATCHDOG_PID
  /// names another process.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool is_listening() const { return socket_ >= 0; }
  /// The watchdog's timeout; zero: no watchdog.
  Span watchdog() const { return watchdog_; }

  /// Extends the time allowed for the start to five seconds from now.
  void starting() { send("EXTEND_TIMEOUT_USEC=5000000"); }
  void ready() { send("READY=1"); }
  void stopping() { send("STOPPING=1"); }
  void alive() { send("WATCHDOG=1"); }
  /// Sends the status line if it has changed.
  void status(const std::string& line);

 private:
  void send(std::string_view text);

  int socket_ = -1;
  std::string address_, status_;
  Span watchdog_;
};

/// Decides from counters whether to feed the watchdog: while every stage with pending work makes progress. A silent
/// sensor does not trip the watchdog, because its driver reopens it; a stuck stage does.
class Liveness {
 public:
  struct Counters {
    std::uint64_t images_taken = 0, images_out = 0, published = 0;
    std::uint64_t passes = 0;  ///< passes of the log thread, ten times a second
  };
  /// True: every stage with pending work has made progress since the last call that returned true.
  bool moved(const Counters& now) noexcept;

 private:
  static constexpr std::uint64_t kQueue = 8;  ///< images between camera and estimator
  Counters last_;
};

}  // namespace epiline
