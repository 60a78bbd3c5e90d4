#include "drivers/check/can_listen.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace epiline {

namespace {

constexpr int kBuffer = 4 << 20;      // bytes of received frames to keep
constexpr int kMostFrames = 1 << 20;  // taken by one call: a full bus must not hold it

}  // namespace

CanListener::~CanListener() {
  if (fd_ >= 0) ::close(fd_);
}

Status CanListener::open(const std::string& interface) {
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kRun, interface, 0, std::move(found), std::move(expected)};
  };
  fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd_ < 0)
    return fail(std::string("no CAN socket: ") + std::strerror(errno), "a kernel with can-raw (sudo modprobe can-raw)");
  ifreq request{};
  interface.copy(request.ifr_name, sizeof(request.ifr_name) - 1);
  if (::ioctl(fd_, SIOCGIFINDEX, &request) != 0) return fail("no such network interface", "one that ip link shows");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (::ioctl(fd_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) == 0)
    return fail("it is down", "sudo ip link set " + interface + " up type can bitrate 500000 (of your bus)");
  const int on = 1;
  ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on));
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &kBuffer, sizeof(kBuffer));
  if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return fail(std::string("bind: ") + std::strerror(errno), "a CAN interface");
  return Done{};
}

std::map<std::uint32_t, std::uint64_t> CanListener::heard() {
  std::map<std::uint32_t, std::uint64_t> counts;
  canfd_frame frame{};
  for (int i = 0; i < kMostFrames; ++i) {
    const ssize_t size = ::read(fd_, &frame, sizeof(frame));
    if (size < static_cast<ssize_t>(sizeof(can_frame))) break;
    ++counts[frame.can_id & CAN_EFF_MASK];
  }
  return counts;
}

}  // namespace epiline
