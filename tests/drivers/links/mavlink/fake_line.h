#pragma once
// A link on a made-up serial line or socket, in its own time.
#include <linux/serial.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/drivers/fake_kernel.h"
#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {

/// The kernel's termios2, whose header and the C library's do not bear each other.
using LineSettings = std::array<std::uint8_t, 44>;
inline constexpr unsigned long kGetSettings = _IOR('T', 0x2A, LineSettings),
                               kSetSettings = _IOW('T', 0x2B, LineSettings);

/// The driver's end of a serial line.
class FakeTerminal final : public test::FakeFile {
 public:
  static constexpr std::size_t kRoom = 4096;  ///< bytes that nobody has read yet

  short ready(std::int64_t /*now_ns*/) override {
    if (is_hung_up) return POLLIN | POLLHUP;
    return static_cast<short>((to_link.empty() ? 0 : POLLIN) | (to_peer.size() < kRoom ? POLLOUT : 0));
  }
  int opened() override { return is_exclusive ? EBUSY : 0; }
  ssize_t read(void* into, std::size_t size) override {
    if (is_hung_up) return 0;
    if (to_link.empty()) return test::refuse(EAGAIN);
    const std::size_t count = std::min(size, to_link.size());
    std::copy_n(to_link.begin(), count, static_cast<std::uint8_t*>(into));
    to_link.erase(to_link.begin(), to_link.begin() + static_cast<std::ptrdiff_t>(count));
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const void* from, std::size_t size) override {
    if (is_hung_up) return test::refuse(EIO);
    const std::size_t count = std::min(size, kRoom - to_peer.size());
    if (count == 0) return test::refuse(EAGAIN);
    const auto* const bytes = static_cast<const std::uint8_t*>(from);
    to_peer.insert(to_peer.end(), bytes, bytes + count);
    return static_cast<ssize_t>(count);
  }
  int ioctl(unsigned long request, void* argument) override {
    switch (request) {
      case kGetSettings:
        return *static_cast<LineSettings*>(argument) = settings_, 0;
      case kSetSettings:
        return settings_ = *static_cast<const LineSettings*>(argument), 0;
      case TIOCEXCL:
        return is_exclusive = true, 0;
      case TIOCNXCL:
        return is_exclusive = false, 0;
      case TCFLSH:
        return 0;
      case TIOCOUTQ:
        return *static_cast<int*>(argument) = queued, 0;
      default:
        return test::refuse(ENOTTY);
    }
  }

  std::deque<std::uint8_t> to_link, to_peer;
  bool is_hung_up = false, is_exclusive = false;
  int queued = 0;  ///< bytes that the kernel has not sent yet

 private:
  LineSettings settings_{};
};

class FakePeer final : public Peer {
 public:
  void send_bytes(std::span<const std::uint8_t> bytes) override {
    terminal->to_link.insert(terminal->to_link.end(), bytes.begin(), bytes.end());
  }
  ssize_t take_bytes(std::span<std::uint8_t> into) override {
    std::deque<std::uint8_t>& from = terminal->to_peer;
    const std::size_t count = std::min(into.size(), from.size());
    std::copy_n(from.begin(), count, into.begin());
    from.erase(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(count));
    return static_cast<ssize_t>(count);
  }
  std::shared_ptr<FakeTerminal> terminal;
};

/// A line that can be pulled out and plugged in again.
class FakeLine {
 public:
  FakeLine() { plug_in(); }
  static std::string path() { return "/dev/ttyMade-up"; }
  void plug_in() {
    peer.terminal = std::make_shared<FakeTerminal>();
    kernel.devices[path()] = peer.terminal;
  }
  void unplug() {
    peer.terminal->is_hung_up = true;
    kernel.devices.erase(path());
  }
  std::int64_t now_ns() const { return kernel.clock_ns; }
  /// The peer answers TIMESYNC by a clock that is `ahead_ns` of ours.
  void answer_timesync(std::int64_t ahead_ns = 0) {
    peer.on_packet = [this, ahead_ns](const Packet& packet) {
      Timesync question;
      if (unpack(packet, question) && question.tc1 == 0)
        peer.send(Timesync{.tc1 = now_ns() + ahead_ns, .ts1 = question.ts1});
    };
  }

  test::FakeKernel kernel;
  FakePeer peer;
};

inline void advance(test::FakeKernel& kernel, MavlinkLink& link, std::int64_t span_ns) {
  kernel.horizon_ns = kernel.clock_ns + span_ns;
  while (kernel.clock_ns < kernel.horizon_ns) link.turn();
}

/// A link on a made-up line, and what it is given to send.
struct LinkOnALine {
  static constexpr std::int64_t kPatience_ms = 20'000;

  explicit LinkOnALine(MavlinkConfig config = {}, const std::optional<ImuDeviceConfig>& imu = std::nullopt)
      : link(on_line(std::move(config)), Mat3::Identity(), imu, 65, line.kernel) {}
  static MavlinkConfig on_line(MavlinkConfig config) {
    config.serial = FakeLine::path();
    return config;
  }
  /// On a made-up line there is no thread.
  void begin() {
    const Status status = link.begin();
    ASSERT_TRUE(status) << status.error().text();
  }
  void advance(std::int64_t span_ns) { mavlink::advance(line.kernel, link, span_ns); }
  /// Publishes at 200 Hz until `done`; the peer reads and speaks meanwhile. False: it took too long.
  bool fly(const std::function<bool()>& done, std::int64_t most_ms = kPatience_ms) {
    for (const std::int64_t until_ns = line.now_ns() + most_ms * kMs; line.now_ns() < until_ns;) {
      estimates.step(link, line.now_ns());
      advance(5 * kMs);
      line.peer.read();
      if (done()) return true;
    }
    return false;
  }
  void fly_for(std::int64_t ms) {
    fly([] { return false; }, ms);
  }
  /// Nothing is published.
  bool wait_for(const std::function<bool()>& done, std::int64_t most_ms = kPatience_ms) {
    for (const std::int64_t until_ns = line.now_ns() + most_ms * kMs; line.now_ns() < until_ns;) {
      advance(2 * kMs);
      line.peer.read();
      if (done()) return true;
    }
    return false;
  }
  void wait_ms(std::int64_t ms) {
    wait_for([] { return false; }, ms);
  }
  template <class Message>
  std::vector<Message> sent() const {
    return line.peer.all<Message>();
  }

  FakeLine line;
  MavlinkLink link;
  Estimates estimates;
};

}  // namespace epiline::mavlink
