#include "drivers/program/live/service.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace epiline {
namespace {

/// A service manager that listens at an abstract address.
class Listener {
 public:
  Listener()
      : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0)), name_("@epiline-" + std::to_string(getpid())) {
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    name_.copy(at.sun_path, name_.size());
    at.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size());
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&at), length), 0);
    ::setenv("NOTIFY_SOCKET", name_.c_str(), 1);
  }
  ~Listener() {
    ::close(socket_);
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
  }
  /// Empty: nothing came.
  std::string heard() const {
    char text[256];
    const ssize_t n = ::recv(socket_, text, sizeof text, 0);
    return n > 0 ? std::string(text, static_cast<std::size_t>(n)) : "";
  }

 private:
  int socket_;
  std::string name_;
};

// A watchdog that is meant for the process that started us is none of ours.
TEST(ServiceManager, HeedsWhoseWatchdogItIs) {
  const Listener listener;
  ::setenv("WATCHDOG_USEC", "2000000", 1);
  for (const auto& [pid, is_ours] : {std::pair{std::to_string(::getpid()), true},
                                     {std::to_string(::getppid()), false},
                                     {std::string("1"), false},
                                     {std::string("x"), false}}) {
    ::setenv("WATCHDOG_PID", pid.c_str(), 1);
    EXPECT_EQ(ServiceManager().watchdog().ns, is_ours ? 2'000'000'000 : 0) << pid;
  }
  ::unsetenv("WATCHDOG_PID");
}

TEST(ServiceManager, SaysWhatSystemdExpects) {
  const Listener listener;
  ::setenv("WATCHDOG_USEC", "2000000", 1);
  ServiceManager service;
  EXPECT_TRUE(service.is_listening());
  EXPECT_EQ(service.watchdog().ns, 2'000'000'000);
  service.ready();
  EXPECT_EQ(listener.heard(), "READY=1");
  service.status("tracking, quality 90");
  service.status("tracking, quality 90");
  EXPECT_EQ(listener.heard(), "STATUS=tracking, quality 90");
  EXPECT_EQ(listener.heard(), "");
  service.alive();
  EXPECT_EQ(listener.heard(), "WATCHDOG=1");
  service.stopping();
  EXPECT_EQ(listener.heard(), "STOPPING=1");
}

TEST(ServiceManager, IsSilentWithoutAListenerAndWithNonsense) {
  {
    ServiceManager service;
    EXPECT_FALSE(service.is_listening());
    service.ready();
  }
  const Listener listener;
  ::setenv("WATCHDOG_USEC", "soon", 1);
  EXPECT_EQ(ServiceManager().watchdog().ns, 0);
  ::setenv("WATCHDOG_USEC", "-5", 1);
  EXPECT_EQ(ServiceManager().watchdog().ns, 0);
  ::setenv("NOTIFY_SOCKET", std::string(400, '/').c_str(), 1);
  EXPECT_FALSE(ServiceManager().is_listening());
  ::setenv("NOTIFY_SOCKET", "relative", 1);
  EXPECT_FALSE(ServiceManager().is_listening());
}

TEST(Liveness, AStageThatTakesNothingOfWhatComesIsNoLife) {
  Liveness liveness;
  Liveness::Counters c{10, 10, 10, 1};
  EXPECT_TRUE(liveness.moved(c));
  EXPECT_FALSE(liveness.moved(c)) << "the log thread stands";
  c.passes = 2;
  EXPECT_TRUE(liveness.moved(c)) << "a camera that gives nothing is no reason";
  c.passes = 3;
  c.images_taken = 100;
  EXPECT_FALSE(liveness.moved(c)) << "the estimator stands";
  c.images_out = 100;
  EXPECT_FALSE(liveness.moved(c)) << "the publisher stands";
  c.published = 99;
  EXPECT_TRUE(liveness.moved(c));
}

}  // namespace
}  // namespace epiline
