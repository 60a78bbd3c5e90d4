#include "drivers/links/mavlink/imu_request.h"

#include <algorithm>

namespace epiline::mavlink {

namespace {

constexpr std::int64_t kAgain_ns = 1'000'000'000, kAway_ns = 2'000'000'000;
constexpr std::uint8_t kTries = 4;
constexpr std::uint8_t kAccepted = 0, kDenied = 2, kUnsupported = 3;  // MAV_RESULT

}  // namespace

std::int64_t ImuRequest::due_ns() const noexcept {
  if (state_ == RequestState::kNone) return 0;
  if (state_ == RequestState::kAsked) return asked_ns_ + kAgain_ns;
  return std::max(asked_ns_, last_reading_ns_) + kAway_ns;
}

CommandLong ImuRequest::question(Address to, std::int64_t now_ns) noexcept {
  if (tries_ == kTries) give_up(now_ns);
  state_ = RequestState::kAsked;
  is_open_ = true;
  asked_ns_ = now_ns;
  const std::uint32_t message = wants_highres_ ? HighresImu::kId : RawImu::kId;
  CommandLong command = command_about(message, kSetMessageInterval, to, interval_us_);
  command.confirmation = tries_++;
  return command;
}

void ImuRequest::restart() noexcept {
  wants_highres_ = true;
  state_ = RequestState::kNone;
  tries_ = 0;
  is_open_ = false;
}

/// The other message then.
void ImuRequest::give_up(std::int64_t now_ns) noexcept {
  if (now_ns - last_reading_ns_ > kAway_ns) wants_highres_ = !wants_highres_;
  tries_ = 0;
}

void ImuRequest::receive(const CommandAck& answer, Address own, std::int64_t now_ns) noexcept {
  if (!is_open_ || !is_for(own, answer) || answer.command != kSetMessageInterval) return;
  if (answer.result == kAccepted) {
    // tries_ stays: one that accepts and sends nothing is asked for the other message in the end
    state_ = RequestState::kAccepted;
  } else if (answer.result == kDenied || answer.result == kUnsupported) {
    state_ = RequestState::kRefused;
    tries_ = kTries;
  } else {
    return;  // not now, or not yet
  }
  is_open_ = false;
  asked_ns_ = now_ns;
}

}  // namespace epiline::mavlink
