#include "drivers/links/mavlink/odometry_encoder.h"

namespace epiline::mavlink {

std::span<const std::uint8_t> FrameEncoder::encode(const epiline::Odometry& odometry, std::uint8_t reset_counter,
                                                   std::uint8_t sequence) noexcept {
  local_frame_.see(odometry, R_VB_);
  Odometry message = odometry_message(odometry, R_VB_, local_frame_);
  message.reset_counter = reset_counter;
  frame_ = frame_of(pack(message, address_, sequence));
  return frame_.bytes();
}

}  // namespace epiline::mavlink
