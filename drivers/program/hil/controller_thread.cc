#include "drivers/program/hil/controller_thread.h"

#include <poll.h>

#include "platform/time/monotonic.h"

namespace epiline::hil {

bool ControllerThread::start() { return thread_.start({.name = "controller", .priority = kPriority}, run, this); }

void ControllerThread::stop() noexcept {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void ControllerThread::run(void* self) { static_cast<ControllerThread*>(self)->loop(); }

void ControllerThread::loop() {
  while (!stop_.load(std::memory_order_relaxed)) {
    pollfd ready{line_.fd(), POLLIN, 0};
    ::poll(&ready, 1, kLook_ms);
    read_line();
    answer();
  }
}

void ControllerThread::read_line() {
  while (const std::size_t got = line_.read(bytes_)) {
    const HostStamp arrival{monotonic_ns()};
    std::span<const std::uint8_t> bytes{bytes_.data(), got};
    while (const mavlink::Packet* packet = parser_.next(bytes)) {
      using mavlink::Signing;
      const bool is_good =
          !signing_ || signing_->check(parser_.raw(), mavlink::signing_time_now()) == Signing::Verdict::kGood;
      if (is_good) model_.receive(*packet, arrival);
    }
    answer();
    if (stop_.load(std::memory_order_relaxed)) return;  // also if somebody never stops talking
  }
}

void ControllerThread::answer() {
  while (const mavlink::Packet* packet = model_.next(HostStamp{monotonic_ns()})) {
    mavlink::FrameBytes frame = mavlink::frame_of(*packet, signing_.has_value());
    if (signing_) signing_->sign(frame, mavlink::signing_time_now());
    line_.write(frame.bytes());
  }
}

}  // namespace epiline::hil
