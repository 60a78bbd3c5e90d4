#pragma once
// A flight controller's reading of our CAN frames: bits to numbers by the published table, frames to epochs, and the
// rules of docs/can.md.
#include <array>
#include <cstdint>
#include <optional>

#include "drivers/links/can/frames.h"
#include "drivers/links/mavlink/message.h"
#include "drivers/program/hil/rules.h"

namespace epiline::hil {

class CanReader {
 public:
  explicit CanReader(int base_id) : base_id_(base_id) {}

  /// A frame as it came, of whatever identifier. An estimate, in MAVLink's axes, when it completes one whose standard
  /// deviations are known: those come a few times a second.
  std::optional<mavlink::Odometry> take(const can::Frame& frame, HostStamp arrival, RuleBook& book);
  /// The newest status says that no odometry comes, and that this is meant.
  bool says_silence() const { return says_silence_; }
  void finish(HostStamp end, RuleBook& book);

 private:
  bool judge_frame(const can::Frame& frame, std::size_t number, HostStamp arrival, RuleBook& book);
  void read(const can::Frame& frame, const can::Message& message);
  bool completes_epoch(std::size_t number, HostStamp arrival, RuleBook& book);
  void judge_status(HostStamp arrival, RuleBook& book);
  mavlink::Odometry odometry(bool fd) const;

  int base_id_;
  can::Values values_;  ///< the newest of each
  std::array<std::optional<std::uint8_t>, can::kMessages.size()> alive_;
  std::optional<std::uint8_t> epoch_;  ///< of classic frames, and which of them have come
  std::uint32_t have_ = 0;
  bool deviations_known_ = false, says_silence_ = false;
  std::optional<HostStamp> newest_status_;
};

}  // namespace epiline::hil
