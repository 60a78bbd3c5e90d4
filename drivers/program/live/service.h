#pragma once
// What a service tells the service manager (sd_notify(3)): one datagram each, to the socket it was given.
#include <cstdint>
#include <string>
#include <string_view>

#include "platform/time/clock.h"

namespace epiline {

/// Does nothing where nobody asked to be told. One thread.
class ServiceManager {
 public:
  /// Takes the socket's name from NOTIFY_SOCKET, the watchdog's time from WATCHDOG_USEC.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool is_listening() const { return socket_ >= 0; }
  /// Zero: no watchdog.
  Span watchdog() const { return watchdog_; }

  void ready() { send("READY=1"); }
  void stopping() { send("STOPPING=1"); }
  void alive() { send("WATCHDOG=1"); }
  /// Sent if it is new.
  void status(const std::string& line);

 private:
  void send(std::string_view text);

  int socket_ = -1;
  std::string address_, status_;
  Span watchdog_;
};

/// Whether a flight goes on: fed with counters, it says that the service manager may be told so. A sensor that gives
/// nothing is no reason to be ended (its driver opens it again, health says so); a stage that takes nothing of what
/// comes, is.
class Liveness {
 public:
  struct Counters {
    std::uint64_t images_taken = 0, images_out = 0, published = 0;
    std::uint64_t passes = 0;  ///< of the log thread, which looks around ten times a second
  };
  /// True: since the last call that returned true everything that had something to do has done something.
  bool moved(const Counters& now) noexcept;

 private:
  static constexpr std::uint64_t kQueue = 8;  ///< images between camera and estimator
  Counters last_;
};

}  // namespace epiline
