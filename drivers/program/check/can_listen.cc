#include "drivers/program/check/can_listen.h"

#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>

namespace epiline {

namespace {

constexpr int kWait_ms = 100;
constexpr int kFramesAtOnce = 256;  // then it looks whether it is to stop: a full bus must not hold it

}  // namespace

Status CanListener::open(const std::string& interface) {
  if (const DeviceTrouble trouble = socket_.open_to_listen(interface.c_str())) return error_of(trouble, interface);
  thread_.emplace([this] { return listen(); });
  return Done{};
}

bool CanListener::listen() {
  pollfd ready{socket_.fd(), POLLIN, 0};
  if (::poll(&ready, 1, kWait_ms) <= 0) return true;
  canfd_frame frame{};
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < kFramesAtOnce; ++i) {
    // an interface that goes down is one error of read(); frames that come after it is up again are received
    const ssize_t size = ::recv(socket_.fd(), &frame, sizeof(frame), MSG_DONTWAIT);
    if (size < static_cast<ssize_t>(CAN_MTU)) return true;
    ++counts_[frame.can_id & (CAN_EFF_FLAG | CAN_EFF_MASK)];
  }
  return true;
}

CanListener::Counts CanListener::heard_so_far() {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace epiline
