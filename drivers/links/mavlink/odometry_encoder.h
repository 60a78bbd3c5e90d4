#pragma once
// Whole ODOMETRY frames for a link that is not ours: ISO-TP on a CAN bus.
#include "drivers/links/mavlink/odometry.h"
#include "drivers/links/mavlink/packet.h"
#include "drivers/links/stream/odometry_encoder.h"
#include "estimator/geometry/types.h"

namespace epiline::mavlink {

class FrameEncoder final : public OdometryEncoder {
 public:
  /// `R_VB` as for odometry_message(). `config`: sender and frame of the poses.
  FrameEncoder(const Mat3& R_VB, const MavlinkConfig& config) noexcept
      : R_VB_(R_VB), address_(address_of(config)), local_frame_(config) {}

  std::span<const std::uint8_t> encode(const epiline::Odometry& odometry, std::uint8_t reset_counter,
                                       std::uint8_t sequence) noexcept override;

 private:
  Mat3 R_VB_;
  Address address_;
  LocalFrame local_frame_;
  FrameBytes frame_;
};

}  // namespace epiline::mavlink
