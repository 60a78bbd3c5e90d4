#pragma once
// Requests the IMU messages from a flight controller until they arrive.
#include <cstdint>

#include "drivers/links/mavlink/message.h"
#include "drivers/links/mavlink/packet.h"

namespace epiline::mavlink {

enum class RequestState : std::uint8_t { kNone, kAsked, kAccepted, kRefused };

/// MAV_CMD_SET_MESSAGE_INTERVAL for HIGHRES_IMU, and for RAW_IMU where the first is not to be had. Asked once a second
/// until there is an answer; and again when readings stay away, for a flight controller that starts anew has forgotten.
/// Times are monotonic_ns().
class ImuRequest {
 public:
  explicit ImuRequest(double rate_hz) noexcept : interval_us_(static_cast<float>(1e6 / rate_hz)) {}

  /// When to send question(), unless something happens before.
  std::int64_t due_ns() const noexcept;
  CommandLong question(Address to, std::int64_t now_ns) noexcept;
  void receive(const CommandAck& answer, Address own, std::int64_t now_ns) noexcept;
  /// A reading came.
  void reading(std::int64_t now_ns) noexcept {
    last_reading_ns_ = now_ns;
    if (state_ == RequestState::kAccepted) tries_ = 0;
  }
  /// Another flight controller, or one that has started anew.
  void restart() noexcept;
  RequestState state() const noexcept { return state_; }

 private:
  void give_up(std::int64_t now_ns) noexcept;

  float interval_us_;
  bool wants_highres_ = true;
  RequestState state_ = RequestState::kNone;
  std::uint8_t tries_ = 0;
  bool is_open_ = false;  ///< a question has no answer yet
  std::int64_t asked_ns_ = 0, last_reading_ns_ = 0;
};

}  // namespace epiline::mavlink
