#pragma once
// Decodes our CAN frames as a flight controller does: signals by the published table, frames grouped into epochs.
// Checks them against the rules of docs/can.md.
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

  /// Takes a frame with any identifier. Returns an estimate, in MAVLink's axes, if the frame completes an epoch and the
  /// standard deviations are known. Frames with standard deviations come a few times a second.
  std::optional<mavlink::Odometry> take(const can::Frame& frame, HostStamp arrival, RuleBook& book);
  /// True if the newest status frame announces that no odometry is sent, on purpose.
  bool says_silence() const { return says_silence_; }
  void finish(HostStamp end, RuleBook& book);

 private:
  bool judge_frame(const can::Frame& frame, std::size_t number, HostStamp arrival, RuleBook& book);
  bool completes_epoch(std::size_t number, HostStamp arrival, RuleBook& book);
  void judge_status(HostStamp arrival, RuleBook& book);
  mavlink::Odometry odometry(bool fd) const;

  int base_id_;
  can::Values values_;  ///< newest value of each signal
  std::array<std::optional<std::uint8_t>, can::kMessages.size()> alive_;
  std::optional<std::uint8_t> epoch_;  ///< of classic frames; `have_` has a bit for each frame received
  std::uint32_t have_ = 0;
  bool deviations_known_ = false, says_silence_ = false;
  std::optional<HostStamp> newest_status_;
};

}  // namespace epiline::hil
