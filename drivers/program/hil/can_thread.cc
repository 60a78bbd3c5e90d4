#include "drivers/program/hil/can_thread.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "drivers/program/hil/controller_thread.h"
#include "platform/time/monotonic.h"

namespace epiline::hil {

Status CanThread::start(const std::string& interface) {
  const auto fail = [&](const char* step, const char* expected) {
    return Error{ErrorKind::kUsage, interface, 0, std::string(step) + ": " + std::generic_category().message(errno),
                 expected};
  };
  constexpr const char* kExpected =
      "a CAN interface that is up (ip link add vcan0 type vcan; ip link set vcan0 mtu 72 up)";
  fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (fd_ < 0) return fail("the kernel has no CAN support", kExpected);
  const int both = 1;
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) return fail("no such network interface", kExpected);
  if (::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &both, sizeof both) != 0 ||
      ::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return fail("cannot listen on it", kExpected);
  if (!thread_.start({.name = "controller", .priority = ControllerThread::kPriority}, run, this))
    return Error{ErrorKind::kRun, interface, 0, "no thread for the controller", ""};
  return Done{};
}

void CanThread::stop() noexcept {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

void CanThread::run(void* self) { static_cast<CanThread*>(self)->loop(); }

void CanThread::loop() {
  while (!stop_.load(std::memory_order_relaxed)) {
    pollfd ready{fd_, POLLIN, 0};
    ::poll(&ready, 1, ControllerThread::kLook_ms);
    canfd_frame raw{};
    const ssize_t got = ::read(fd_, &raw, sizeof raw);
    if (got != CAN_MTU && got != CANFD_MTU) continue;
    constexpr std::uint32_t kOther = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG;
    if ((raw.can_id & kOther) != 0 || raw.len > can::kFdBytes) continue;
    can::Frame frame;
    frame.id = static_cast<std::uint16_t>(raw.can_id & CAN_SFF_MASK);
    frame.size = raw.len;
    std::copy_n(raw.data, raw.len, frame.data.begin());
    model_.receive(frame, HostStamp{monotonic_ns()});
  }
}

}  // namespace epiline::hil
