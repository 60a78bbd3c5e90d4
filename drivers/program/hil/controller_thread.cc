#include "drivers/program/hil/controller_thread.h"

#include <linux/can.h>
#include <poll.h>

#include <algorithm>
#include <cstring>

#include "platform/time/monotonic.h"

namespace epiline::hil {

Status ControllerThread::start() {
  // above the priority of everything under test: arrivals must not be stamped late because this thread had to wait
  constexpr int kPriority = 85;
  const auto forever = [this] {
    step();
    return true;
  };
  if (thread_.start({.name = "controller", .priority = kPriority}, forever)) return Done{};
  return Error{ErrorKind::kRun, "", 0, "no thread for the controller", ""};
}

void ControllerThread::step() {
  constexpr int kLook_ms = 2;
  pollfd ready{line_.fd(), POLLIN, 0};
  ::poll(&ready, 1, kLook_ms);
  const std::size_t got = line_.read(bytes_);
  const HostStamp arrival{monotonic_ns()};
  if (model_.is_on_can()) {
    hear_frame(got, arrival);
  } else {
    hear({bytes_.data(), got}, arrival);
  }
  answer();
}

void ControllerThread::hear(std::span<const std::uint8_t> bytes, HostStamp arrival) {
  while (const mavlink::Packet* packet = parser_.next(bytes)) {
    using mavlink::Signing;
    const bool is_good =
        !signing_ || signing_->check(parser_.raw(), mavlink::signing_time_now()) == Signing::Verdict::kGood;
    if (is_good) model_.receive(*packet, arrival);
  }
}

/// `got`: bytes that were read, of a frame.
void ControllerThread::hear_frame(std::size_t got, HostStamp arrival) {
  canfd_frame raw{};
  if (got != CAN_MTU && got != CANFD_MTU) return;
  std::memcpy(&raw, bytes_.data(), got);
  constexpr std::uint32_t kOther = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG;
  if ((raw.can_id & kOther) != 0 || raw.len > can::kFdBytes) return;
  can::Frame frame;
  frame.id = static_cast<std::uint16_t>(raw.can_id & CAN_SFF_MASK);
  frame.size = raw.len;
  std::copy_n(raw.data, raw.len, frame.data.begin());
  model_.receive(frame, arrival);
}

void ControllerThread::answer() {
  while (const mavlink::Packet* packet = model_.next(HostStamp{monotonic_ns()})) {
    mavlink::FrameBytes frame = mavlink::frame_of(*packet, signing_.has_value());
    if (signing_) signing_->sign(frame, mavlink::signing_time_now());
    line_.write(frame.bytes());
  }
}

}  // namespace epiline::hil
