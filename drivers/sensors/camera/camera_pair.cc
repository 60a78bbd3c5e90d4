#include "drivers/sensors/camera/camera_pair.h"

#include <algorithm>
#include <ctime>
#include <utility>

#include "platform/concurrency/counter.h"
#include "platform/error/contract.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {
constexpr Span kIdle = Span::from_milliseconds(20);         // between looks at whether it is over
constexpr Span kClockJump = Span::from_milliseconds(1000);  // stamps farther apart are others' to judge
constexpr double kSilent = 2.5;                             // periods without an image of the first camera
constexpr const char* kThreadNames[kMostOthers] = {"camera2", "camera3", "camera4"};
constexpr timespec kRest = {0, 10'000'000};  // a lost device may fail at once
}  // namespace

Status CameraPair::open() {
  if (Status first = first_->open(); !first) return first;
  if (Status second = second_->open(); !second) {
    first_->close();
    return second;
  }
  stops_.store(false, std::memory_order_relaxed);
  missed_ = 0;
  first_came_ns_ = 0;
  period_ = {};
  black_.assign(static_cast<std::size_t>(settings_.width) * static_cast<std::size_t>(settings_.height), 0);
  const auto body = [](void* self) { static_cast<CameraPair*>(self)->read_second(); };
  if (thread_.start({kThreadNames[settings_.number - 1], settings_.priority, settings_.cpu}, body, this)) return Done{};
  close();
  return Error{ErrorKind::kRun, kThreadNames[settings_.number - 1], 0, "cannot start a thread",
               "a free thread (ulimit -u)"};
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
  // The second camera does not wait for long in either case: only a few of its images find room.
  const Span patience = std::min(timeout, kIdle);
  const ReadOutcome outcome = first_->read(frame, is_overdue(first_came_ns_) ? Span{} : patience);
  if (outcome == ReadOutcome::kSample) return lead(frame) ? outcome : ReadOutcome::kTimeout;
  if (outcome == ReadOutcome::kEnd || !is_overdue(first_came_ns_)) return outcome;
  if (stand_in(frame, patience)) return ReadOutcome::kSample;
  return stood_in_ && !is_overdue(alone_came_ns_) ? ReadOutcome::kTimeout : outcome;  // one camera is there
}

bool CameraPair::lead(const Frame& frame) noexcept {
  EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < slots_alone(), "a camera of a pair numbers its buffers from 0 to 63");
  const bool came_before = std::exchange(first_came_ns_, monotonic_ns()) != 0;
  const Span since = frame.stamp - first_stamp_;
  if (came_before && !stood_in_ && since.ns > 0 && since < kClockJump) period_ = since;
  first_stamp_ = frame.stamp;
  stood_in_ = stood_in_ && is_old(frame.stamp);
  if (stood_in_) {
    first_->give_back(frame);
    return false;
  }
  newest_ = frame.stamp;
  sequence_ = frame.sequence;
  Frame& second = second_of_[static_cast<std::size_t>(frame.slot)];
  second = {};
  const bool is_pair = match(frame.stamp, second);
  missed_ = is_pair ? 0 : missed_ + 1;
  bump(is_pair ? pairs_ : without_);
  return true;
}

bool CameraPair::is_old(HostStamp stamp) const noexcept {
  const Span behind = newest_ - stamp;
  return behind.ns >= 0 && behind < kClockJump;
}

bool CameraPair::is_overdue(std::int64_t last_ns) const noexcept {
  const auto silent_ns = static_cast<double>(monotonic_ns() - last_ns);
  return first_came_ns_ != 0 && period_.ns > 0 && !black_.empty() &&
         silent_ns > kSilent * static_cast<double>(period_.ns);
}

bool CameraPair::stand_in(Frame& frame, Span timeout) noexcept {
  while (came_.wait_until(monotonic_ns() + timeout.ns, [&] { return ring_.front() != nullptr; })) {
    const Frame second = *ring_.front();
    ring_.pop();
    if (is_old(second.stamp)) {
      second_->give_back(second);
      bump(unused_);
      continue;
    }
    EPILINE_EXPECTS(second.slot >= 0 && second.slot < kMostSlots,
                    "a camera of a pair numbers its buffers from 0 to 63");
    frame = second;
    frame.data = black_.data();
    frame.width = frame.stride = settings_.width;
    frame.height = settings_.height;
    frame.slot = slots_alone() + second.slot;
    frame.sequence = ++sequence_;
    second_of_[static_cast<std::size_t>(frame.slot)] = second;
    newest_ = second.stamp;
    stood_in_ = true;
    alone_came_ns_ = monotonic_ns();
    bump(alone_);
    return true;
  }
  return false;
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
OtherFrames CameraPair::others(const Frame& frame) const noexcept {
  OtherFrames others = frame.slot < slots_alone() ? first_->others(frame) : OtherFrames{};
  others[settings_.number - 1] = second_of_[static_cast<std::size_t>(frame.slot)];
  return others;
}

void CameraPair::give_back(const Frame& frame) noexcept {
  const Frame second = second_of_[static_cast<std::size_t>(frame.slot)];  // before another image may have the slot
  if (second.data != nullptr) second_->give_back(second);
  if (frame.slot < slots_alone()) first_->give_back(frame);
}

PairCounts CameraPair::counts() const noexcept {
  const auto value = [](const std::atomic<std::uint64_t>& counter) { return counter.load(std::memory_order_relaxed); };
  return {value(pairs_), value(without_), value(unused_) + ring_.dropped(), value(alone_)};
}

}  // namespace epiline
