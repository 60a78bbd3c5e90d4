#include "drivers/links/can/can_socket.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace epiline::can {

namespace {

// Memory of frames that wait in the kernel: about one epoch. What waits longer is old, and cannot be taken back.
constexpr int kSendMemory = 4096;
constexpr int kNewsAtOnce = 64;

ifreq request_for(const char* interface) noexcept {
  ifreq request{};
  std::strncpy(request.ifr_name, interface, IFNAMSIZ - 1);
  return request;
}

}  // namespace

template <class T>
bool CanSocket::set(int level, int option, const T& value) noexcept {
  return system_.setsockopt(fd_, level, option, &value, sizeof value) == 0;
}

DeviceTrouble CanSocket::fail(const DeviceTrouble& trouble) noexcept {
  close();
  return trouble;
}

DeviceTrouble CanSocket::refused(const char* step) noexcept {
  DeviceTrouble trouble = device_refusal(step, errno, "a CAN interface that this user may use");
  std::strncpy(trouble.found, "cannot open a socket", sizeof trouble.found - 1);
  return fail(trouble);
}

void CanSocket::close() noexcept {
  if (fd_ >= 0) system_.close(fd_);
  fd_ = -1;
}

DeviceTrouble CanSocket::open(const char* interface, bool fd, int& index) noexcept {
  close();
  fd_ = system_.socket(PF_CAN, SOCK_RAW, CAN_RAW);
  if (fd_ < 0) {
    DeviceTrouble trouble = device_refusal("socket", errno, "the kernel module can-raw (modprobe can-raw)");
    std::strncpy(trouble.found, "the kernel has no CAN support", sizeof trouble.found - 1);
    return trouble;
  }
  ifreq request = request_for(interface);
  if (std::strlen(interface) >= IFNAMSIZ || system_.ioctl(fd_, SIOCGIFINDEX, &request) != 0)
    return fail(device_refusal("SIOCGIFINDEX", ENODEV, "a network interface that `ip -br link` shows"));
  index = request.ifr_ifindex;
  if (system_.ioctl(fd_, SIOCGIFHWADDR, &request) != 0) return refused("SIOCGIFHWADDR");
  if (request.ifr_hwaddr.sa_family != ARPHRD_CAN)
    return fail(device_refusal("not a CAN interface", 0, "one that `ip -br link show type can` shows"));
  if (system_.ioctl(fd_, SIOCGIFFLAGS, &request) != 0) return refused("SIOCGIFFLAGS");
  if ((request.ifr_flags & IFF_UP) == 0) {
    DeviceTrouble down = device_refusal("SIOCGIFFLAGS", ENETDOWN);
    std::snprintf(down.expected, sizeof down.expected,
                  "an interface that is up: ip link set %s up type can bitrate BITRATE", interface);
    return fail(down);
  }
  if (system_.ioctl(fd_, SIOCGIFMTU, &request) != 0) return refused("SIOCGIFMTU");
  if (fd && request.ifr_mtu < static_cast<int>(CANFD_MTU))
    return fail(device_refusal("the interface carries classic frames only", 0,
                               "can.fd = false, or an interface that is set up with dbitrate BITRATE fd on"));
  return {};
}

DeviceTrouble CanSocket::bind(int index) noexcept {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  if (system_.bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return refused("bind");
  return {};
}

DeviceTrouble CanSocket::open_to_send(const char* interface, bool fd) noexcept {
  int index = 0;
  if (const DeviceTrouble trouble = open(interface, fd, index)) return trouble;
  const can_err_mask_t news = CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_ACK;
  const bool good = system_.setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) == 0 &&  // no frames of others
                    set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, news) && set(SOL_SOCKET, SO_SNDBUF, kSendMemory) &&
                    (!fd || set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1));
  if (!good) return refused("setsockopt");
  return bind(index);
}

DeviceTrouble CanSocket::open_to_receive(const char* interface, std::uint32_t id, bool extended) noexcept {
  int index = 0;
  if (const DeviceTrouble trouble = open(interface, false, index)) return trouble;
  // exactly these frames: not those of the other format with the same number, and no requests for them
  const can_filter filter = {id | (extended ? CAN_EFF_FLAG : 0),
                             CAN_EFF_FLAG | CAN_RTR_FLAG | (extended ? CAN_EFF_MASK : CAN_SFF_MASK)};
  const int stamps = SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE | SOF_TIMESTAMPING_RX_SOFTWARE |
                     SOF_TIMESTAMPING_SOFTWARE;
  const bool good = set(SOL_CAN_RAW, CAN_RAW_FILTER, filter) && set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1) &&
                    set(SOL_SOCKET, SO_TIMESTAMPING, stamps) && set(SOL_SOCKET, SO_RXQ_OVFL, 1);
  if (!good) return refused("setsockopt");
  return bind(index);
}

DeviceTrouble CanSocket::open_to_listen(const char* interface) noexcept {
  int index = 0;
  if (const DeviceTrouble trouble = open(interface, false, index)) return trouble;
  if (!set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1)) return refused("setsockopt");
  return bind(index);
}

int CanSocket::send(const Frame& frame) noexcept {
  canfd_frame raw{};  // the head of a classic frame is the same
  raw.can_id = frame.id;
  raw.len = frame.size;
  raw.flags = frame.is_fd() ? CANFD_BRS : 0;
  std::memcpy(raw.data, frame.data.data(), frame.size);
  const std::size_t size = frame.is_fd() ? CANFD_MTU : CAN_MTU;
  const ssize_t sent = system_.write(fd_, &raw, size);
  return sent == static_cast<ssize_t>(size) ? 0 : sent < 0 ? errno : EIO;
}

BusNews CanSocket::news() noexcept {
  BusNews news;
  for (int i = 0; i < kNewsAtOnce; ++i) {
    canfd_frame frame{};
    const ssize_t size = system_.read(fd_, &frame, sizeof frame);
    if (size < 0) {
      if (errno != EAGAIN && errno != EINTR) news.error = errno;
      break;
    }
    if (size < static_cast<ssize_t>(CAN_MTU) || (frame.can_id & CAN_ERR_FLAG) == 0) continue;
    ++news.error_frames;
    if ((frame.can_id & CAN_ERR_BUSOFF) != 0) news.bus_off = true;
    if ((frame.can_id & CAN_ERR_RESTARTED) != 0) {
      news.restarted = true;
      news.bus_off = false;  // an earlier one is over
    }
    if ((frame.can_id & CAN_ERR_CRTL) == 0) continue;
    const bool is_passive = (frame.data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
    const bool is_better =
        (frame.data[1] & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_ACTIVE)) != 0;
    if (!is_passive && !is_better) continue;
    news.error_passive = is_passive;
    news.error_active = !is_passive;
  }
  return news;
}

}  // namespace epiline::can
