#pragma once
// From the instant a camera driver stamps to the middle of the exposure, which is what an image's stamp means here.
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

enum class Shutter : std::uint8_t {
  kGlobal,   ///< all rows are exposed at once, then read out
  kRolling,  ///< each row is read out as soon as its exposure ends, one after the other
};
enum class StampPoint : std::uint8_t {
  kStartOfExposure,  ///< of the first row
  kEndOfFrame,       ///< the last row has arrived
};

/// What must be added to the driver's stamp. `readout`: from the first row's arrival to the last one's. With a rolling
/// shutter the image belongs to its middle row.
///
///     global    |--exposure--|--readout--|          rolling    first row   |--exposure--|
///               ^ start      end of frame ^                    middle row        |--exposure--|
///                                                              last row                |--exposure--| end of frame
constexpr Span to_mid_exposure(StampPoint point, Shutter shutter, Span exposure, Span readout) noexcept {
  const Span from_start{exposure.ns / 2 + (shutter == Shutter::kRolling ? readout.ns / 2 : 0)};
  return point == StampPoint::kStartOfExposure ? from_start : from_start - exposure - readout;
}

}  // namespace epiline
