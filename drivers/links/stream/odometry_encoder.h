#pragma once
// Encodes odometry as messages of another protocol, for links that do not know this protocol.
#include <cstdint>
#include <span>

#include "platform/samples/samples.h"

namespace epiline {

class OdometryEncoder {
 public:
  virtual ~OdometryEncoder() = default;
  /// One message, valid until the next call. `sequence`: number of the message, counted by the link. Does not allocate.
  virtual std::span<const std::uint8_t> encode(const Odometry& odometry, std::uint8_t reset_counter,
                                               std::uint8_t sequence) noexcept = 0;
};

}  // namespace epiline
