#pragma once
// What the tests of CAN share: a vcan of the kernel, and a peer on it that has nothing of ours.
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/hardware/support.h"

namespace epiline {

inline constexpr const char* kBus = "vcan7";

inline bool shell(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }
inline bool make_bus() {
  const std::string bus = kBus;
  return shell("ip link add " + bus + " type vcan") && shell("ip link set " + bus + " mtu 72 up");
}
inline bool set_bus(const std::string& what) { return shell("ip link set " + std::string(kBus) + " " + what); }
inline void remove_bus() { shell("ip link del " + std::string(kBus)); }

class CanBus : public testing::Test {
 protected:
  void SetUp() override {
    shell("/sbin/modprobe vcan; /sbin/modprobe can-raw");
    if (!make_bus()) GTEST_SKIP() << "no vcan can be had; expected ./run hardware";
  }
  void TearDown() override { remove_bus(); }
};

struct Seen {
  canfd_frame frame{};
  bool fd = false;
  std::int64_t at_ns = 0;
};

/// Another node on the bus. It hears everything, or only what the constructor says.
class Peer {
 public:
  explicit Peer(bool hears = true) {
    fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    EXPECT_GE(fd_, 0);
    const int on = 1, memory = 8 << 20;
    ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUFFORCE, &memory, sizeof memory);
    if (!hears) ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(kBus));
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ~Peer() { ::close(fd_); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  std::optional<Seen> hear(int timeout_ms = 10'000) {
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, timeout_ms) <= 0) return std::nullopt;
    Seen seen;
    const ssize_t size = ::recv(fd_, &seen.frame, sizeof seen.frame, MSG_DONTWAIT);
    if (size < 0) return std::nullopt;
    seen.fd = size == static_cast<ssize_t>(CANFD_MTU);
    seen.at_ns = monotonic_ns();
    return seen;
  }
  void forget() {
    canfd_frame frame;
    while (::recv(fd_, &frame, sizeof frame, MSG_DONTWAIT) > 0 || errno != EAGAIN) {
    }  // news of the interface are errors in between
  }
  bool say(std::uint32_t id, const std::vector<std::uint8_t>& data, bool fd = false) {
    canfd_frame frame{};
    frame.can_id = id;
    frame.len = static_cast<std::uint8_t>(data.size());
    std::memcpy(frame.data, data.data(), data.size());
    const std::size_t size = fd ? CANFD_MTU : CAN_MTU;
    return ::send(fd_, &frame, size, 0) == static_cast<ssize_t>(size);
  }

 private:
  int fd_ = -1;
};

/// Everything that can be on a bus, as fast as it goes, until destroyed.
class Flood {
 public:
  /// Spares one identifier, in its own format and without request.
  explicit Flood(std::uint32_t spared = ~0U)
      : thread_([this, spared] {
          Peer peer(false);
          std::uint32_t random = 12345;
          const auto next = [&] { return random = random * 1664525 + 1013904223, random >> 8; };
          while (!stop_.load()) {
            const std::uint32_t flags[] = {0, CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_EFF_FLAG | CAN_RTR_FLAG};
            const std::uint32_t flag = flags[next() % 4];
            const std::uint32_t id = next() % 3 == 0 ? spared & CAN_SFF_MASK : next() & CAN_SFF_MASK;
            if ((id | flag) == spared) continue;
            const bool fd = next() % 4 == 0 && (flag & CAN_RTR_FLAG) == 0;
            std::vector<std::uint8_t> data(next() % (fd ? 65 : 9));
            for (std::uint8_t& byte : data) byte = static_cast<std::uint8_t>(next());
            if (peer.say(id | flag, data, fd)) frames_.fetch_add(1);
          }
        }) {}
  ~Flood() {
    stop_.store(true);
    thread_.join();
  }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;
  std::uint64_t frames() const { return frames_.load(); }

 private:
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> frames_{0};
  std::thread thread_;
};

}  // namespace epiline
