#include "drivers/sensors/camera/camera_pair.h"

#include <ctime>

#include "platform/concurrency/counter.h"
#include "platform/error/contract.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {
constexpr Span kIdle = Span::from_milliseconds(20);  // between looks at whether it is over
constexpr timespec kRest = {0, 10'000'000};          // a lost device may fail at once
}  // namespace

Status CameraPair::open() {
  if (Status first = first_->open(); !first) return first;
  if (Status second = second_->open(); !second) {
    first_->close();
    return second;
  }
  stops_.store(false, std::memory_order_relaxed);
  missed_ = 0;
  const auto body = [](void* self) { static_cast<CameraPair*>(self)->read_second(); };
  if (thread_.start({"camera2", settings_.priority, settings_.cpu}, body, this)) return Done{};
  close();
  return Error{ErrorKind::kRun, "second camera", 0, "cannot start a thread", "a free thread (ulimit -u)"};
}

void CameraPair::close() noexcept {
  stops_.store(true, std::memory_order_relaxed);
  thread_.join();
  while (ring_.front() != nullptr) ring_.pop();
  second_->close();
  first_->close();
}

void CameraPair::read_second() noexcept {
  while (!stops_.load(std::memory_order_relaxed)) {
    Frame frame;
    const ReadOutcome outcome = second_->read(frame, kIdle);
    if (outcome == ReadOutcome::kEnd) return;
    if (outcome == ReadOutcome::kFailed) nanosleep(&kRest, nullptr);
    if (outcome != ReadOutcome::kSample) continue;
    frame.stamp = frame.stamp + settings_.second_later;
    if (ring_.push(frame)) {
      came_.notify();
    } else {  // the first camera is silent
      second_->give_back(frame);
    }
  }
}

ReadOutcome CameraPair::read(Frame& frame, Span timeout) noexcept {
  const ReadOutcome outcome = first_->read(frame, timeout);
  if (outcome != ReadOutcome::kSample) return outcome;
  EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < kMostSlots, "a camera of a pair numbers its buffers from 0 to 63");
  Frame& second = second_of_[static_cast<std::size_t>(frame.slot)];
  second = {};
  const bool is_pair = match(frame.stamp, second);
  missed_ = is_pair ? 0 : missed_ + 1;
  bump(is_pair ? pairs_ : without_);
  return outcome;
}

bool CameraPair::match(HostStamp stamp, Frame& second) noexcept {
  const std::int64_t until_ns = monotonic_ns() + (missed_ < kPatient ? settings_.patience.ns : 0);
  while (came_.wait_until(until_ns, [&] { return ring_.front() != nullptr; })) {
    const Frame next = *ring_.front();
    const Span later = next.stamp - stamp;
    if (later > settings_.within) return false;  // of an image to come
    ring_.pop();
    if (Span{-later.ns} <= settings_.within) {
      second = next;
      return true;
    }
    second_->give_back(next);
    bump(unused_);
  }
  return false;
}

/// Written before the image went on.
Frame CameraPair::second(const Frame& frame) const noexcept { return second_of_[static_cast<std::size_t>(frame.slot)]; }

void CameraPair::give_back(const Frame& frame) noexcept {
  const Frame second = second_of_[static_cast<std::size_t>(frame.slot)];  // before another image may have the slot
  if (second.data != nullptr) second_->give_back(second);
  first_->give_back(frame);
}

PairCounts CameraPair::counts() const noexcept {
  const auto value = [](const std::atomic<std::uint64_t>& counter) { return counter.load(std::memory_order_relaxed); };
  return {value(pairs_), value(without_), value(unused_) + ring_.dropped()};
}

}  // namespace epiline
