#pragma once
// The other end of a link, and something to fly: shared by the tests of the link.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "drivers/links/mavlink/link.h"
#include "drivers/links/mavlink/packet.h"
#include "platform/time/monotonic.h"
#include "platform/time/two_way_sync.h"
#include "tests/support/times.h"

namespace epiline::mavlink {

inline constexpr Address kController{1, 1};

inline void set_nonblocking(int fd) { ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) | O_NONBLOCK); }

/// A flight controller's end: a pseudo terminal's master, or a socket.
class Peer {
 public:
  Peer() = default;
  explicit Peer(int fd) : fd_(fd) { set_nonblocking(fd); }
  virtual ~Peer() { hang_up(); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  int fd() const { return fd_; }
  void take(int fd) {
    hang_up();
    fd_ = fd;
    set_nonblocking(fd);
  }
  void hang_up() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

  template <class Message>
  void send(const Message& message, Address from = kController) {
    const FrameBytes frame = frame_of(pack(message, from, sequence_++));
    send_bytes(frame.bytes());
  }
  virtual void send_bytes(std::span<const std::uint8_t> bytes) {
    [[maybe_unused]] const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
  }
  /// What has come, as read() of a file that does not wait.
  virtual ssize_t take_bytes(std::span<std::uint8_t> into) { return ::read(fd_, into.data(), into.size()); }
  void heartbeat(Address from = kController) { send(Heartbeat{.type = 2, .autopilot = 12}, from); }

  /// Takes what has come.
  void read() {
    std::array<std::uint8_t, 4096> piece;
    for (ssize_t n = take_bytes(piece); n > 0; n = take_bytes(piece)) {
      std::span<const std::uint8_t> bytes(piece.data(), static_cast<std::size_t>(n));
      while (const Packet* const packet = parser_.next(bytes)) {
        packets.push_back(*packet);
        if (on_packet) on_packet(*packet);
      }
    }
  }
  /// The messages of one kind that came so far.
  template <class Message>
  std::vector<Message> all() const {
    std::vector<Message> found;
    for (const Packet& packet : packets) {
      Message message;
      if (unpack(packet, message)) found.push_back(message);
    }
    return found;
  }
  const Parser& parser() const { return parser_; }

  std::vector<Packet> packets;
  std::function<void(const Packet&)> on_packet;

 private:
  int fd_ = -1;
  std::uint8_t sequence_ = 0;
  Parser parser_;
};

/// A pseudo terminal behind a path that stays when it is made anew, as udev's names do.
class PseudoTerminal {
 public:
  PseudoTerminal() {
    char name[] = "/tmp/epiline_pty_XXXXXX";
    folder_ = ::mkdtemp(name);
    plug_in();
  }
  ~PseudoTerminal() {
    unplug();
    ::rmdir(folder_.c_str());
  }
  std::string path() const { return folder_ + "/line"; }
  void plug_in() {
    int master = -1, slave = -1;
    char name[64] = {};
    ASSERT_EQ(::openpty(&master, &slave, name, nullptr, nullptr), 0);
    termios raw{};
    ::tcgetattr(slave, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(slave, TCSANOW, &raw);
    ::close(slave);
    peer.take(master);
    ASSERT_EQ(::symlink(name, path().c_str()), 0);
  }
  void unplug() {
    peer.hang_up();
    ::unlink(path().c_str());
  }

  Peer peer;

 private:
  std::string folder_;
};

/// What a pipeline hands out while it flies straight on.
class Estimates {
 public:
  /// One prediction, stamped now; every tenth has a new image in it.
  void step(MavlinkLink& link, std::int64_t now_ns = monotonic_ns()) {
    odometry.stamp = HostStamp{now_ns};
    odometry.p_WB_m[0] = 1e-9 * static_cast<double>(odometry.stamp.ns % 1'000'000'000'000);
    if (++steps_ % 10 == 0) {
      epiline::Odometry image = odometry;
      image.stamp = odometry.stamp - Span{2 * kMs};
      link.publish_image(image);
      ++images;
    }
    link.publish(odometry);
  }

  epiline::Odometry odometry = [] {
    epiline::Odometry o;
    o.health = {HealthState::kTracking, 0, 90};
    for (std::size_t i = 0; i < 16; ++i) o.covariance[17 * i] = 1e-4;
    return o;
  }();
  int images = 0;

 private:
  int steps_ = 0;
};

/// Publishes at 200 Hz until `done` or for `most_ms`; the peer reads and speaks meanwhile. True: done.
inline bool fly(
    MavlinkLink& link, Estimates& estimates, Peer& peer, std::int64_t most_ms, const std::function<bool()>& done,
    const std::function<void()>& each = [] {}) {
  const std::int64_t until_ns = monotonic_ns() + most_ms * kMs;
  while (monotonic_ns() < until_ns) {
    estimates.step(link);
    each();
    ::usleep(5000);
    peer.read();
    if (done()) return true;
  }
  return false;
}
/// Nothing is published.
inline bool wait_for(Peer& peer, std::int64_t most_ms, const std::function<bool()>& done) {
  const std::int64_t until_ns = monotonic_ns() + most_ms * kMs;
  while (monotonic_ns() < until_ns) {
    ::usleep(2000);
    peer.read();
    if (done()) return true;
  }
  return false;
}

inline std::vector<std::uint8_t> from_hex(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

inline constexpr std::int64_t kBoot_ns = 1000 * kSecond;  ///< of the flight controller of settled_clock(), on our clock
/// A clock model after `exchanges` good ones; the last began 0.1 s before the controller was up for `up_ns`.
inline TwoWaySync settled_clock(int exchanges, std::int64_t up_ns = 100 * kSecond) {
  TwoWaySync clock{TwoWaySettings{}};
  for (int i = exchanges; i > 0; --i) {
    const HostStamp sent{kBoot_ns + up_ns - i * 100 * kMs};
    clock.update(sent, DeviceStamp{sent.ns + kMs - kBoot_ns}, sent + Span{2 * kMs});
  }
  return clock;
}

/// The defaults but for one setting.
template <class Config, class T>
Config config_with(T Config::*setting, const std::type_identity_t<T>& value) {
  Config config;
  config.*setting = value;
  return config;
}
inline MavlinkConfig serial_config(const std::string& path) { return config_with(&MavlinkConfig::serial, path); }
/// Poses in LOCAL_NED.
inline MavlinkConfig north(double heading_deg) {
  MavlinkConfig config = config_with(&MavlinkConfig::frame, 1);
  config.heading_deg = heading_deg;
  return config;
}

}  // namespace epiline::mavlink
