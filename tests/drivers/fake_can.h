#pragma once
// A CAN interface and its sockets on a FakeKernel.
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>

#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "tests/drivers/fake_kernel.h"

namespace epiline::test {

/// One interface, with what was sent on it and what its sockets are to hear of it.
class FakeCanBus {
 public:
  struct Sent {
    std::int64_t at_ns = 0;
    canfd_frame frame{};
    bool fd = false;
  };

  FakeCanBus(FakeKernel& in, std::string called) : kernel(in), name(std::move(called)) {
    kernel.make_socket = [this](int domain, int /*type*/, int /*protocol*/) -> FakeKernel::File {
      if (domain != PF_CAN || !speaks_can) return errno = EAFNOSUPPORT, nullptr;
      return std::make_shared<Socket>(*this);
    };
  }

  /// What a controller's driver tells of the bus.
  void tell(std::uint32_t what, std::uint8_t controller = 0) {
    canfd_frame frame{};
    frame.can_id = CAN_ERR_FLAG | what;
    frame.len = CAN_ERR_DLC;
    frame.data[1] = controller;
    news.push_back(frame);
  }
  void set_up(bool on) {
    is_up = on;
    if (!on) fault = ENETDOWN;
  }
  void remove() {
    exists = is_up = false;
    fault = ENODEV;
  }
  void plug_in() { exists = is_up = true; }

  FakeKernel& kernel;
  std::string name;
  bool speaks_can = true, exists = true, is_can = true, is_up = true, has_fd = true;
  std::size_t room = std::numeric_limits<std::size_t>::max();  ///< frames the queue takes; then it is full
  std::vector<Sent> sent;
  std::deque<canfd_frame> news;
  int fault = 0;         ///< of the next read
  int option_error = 0;  ///< of setsockopt()
  int attempts = 0;      ///< to open a socket on it

 private:
  class Socket final : public FakeFile {
   public:
    explicit Socket(FakeCanBus& bus) : bus_(bus) {}
    int ioctl(unsigned long request, void* argument) override {
      auto& asked = *static_cast<ifreq*>(argument);
      if (request == SIOCGIFINDEX) ++bus_.attempts;
      if (!bus_.exists || bus_.name != asked.ifr_name) return refuse(ENODEV);
      switch (request) {
        case SIOCGIFINDEX:
          return asked.ifr_ifindex = 7, 0;
        case SIOCGIFHWADDR:
          return asked.ifr_hwaddr.sa_family = bus_.is_can ? ARPHRD_CAN : ARPHRD_ETHER, 0;
        case SIOCGIFFLAGS:
          return asked.ifr_flags = bus_.is_up ? IFF_UP : 0, 0;
        case SIOCGIFMTU:
          return asked.ifr_mtu = bus_.has_fd ? static_cast<int>(CANFD_MTU) : static_cast<int>(CAN_MTU), 0;
        default:
          return refuse(ENOTTY);
      }
    }
    int setsockopt(int /*level*/, int /*option*/, const void* /*value*/, socklen_t /*length*/) override {
      return bus_.option_error != 0 ? refuse(bus_.option_error) : 0;
    }
    ssize_t read(void* into, std::size_t size) override {
      if (bus_.fault != 0) return refuse(std::exchange(bus_.fault, 0));
      if (bus_.news.empty() || size < sizeof(canfd_frame)) return refuse(EAGAIN);
      std::memcpy(into, &bus_.news.front(), CAN_MTU);
      bus_.news.pop_front();
      return CAN_MTU;
    }
    ssize_t write(const void* from, std::size_t size) override {
      if (!bus_.exists) return refuse(ENXIO);
      if (!bus_.is_up) return refuse(ENETDOWN);
      if (bus_.room == 0) return refuse(ENOBUFS);
      --bus_.room;
      Sent one;
      one.at_ns = bus_.kernel.clock_ns;
      one.fd = size == CANFD_MTU;
      std::memcpy(&one.frame, from, size);
      bus_.sent.push_back(one);
      return static_cast<ssize_t>(size);
    }

   private:
    FakeCanBus& bus_;
  };
};

}  // namespace epiline::test
