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
  kFirstRow,         ///< the first row begins to arrive: its exposure has ended. As receivers of CSI stamp
};

/// What must be added to the driver's stamp for the start of the first row's exposure. `readout`: from the first row's
/// arrival to the last one's.
constexpr Span to_start_of_exposure(StampPoint point, Span exposure, Span readout) noexcept {
  switch (point) {
    case StampPoint::kFirstRow:
      return -exposure;
    case StampPoint::kEndOfFrame:
      return -exposure - readout;
    default:
      return {};
  }
}

/// What must be added to the driver's stamp. With a rolling shutter the image belongs to its middle row.
///
///     global    |--exposure--|--readout--|          rolling    first row   |--exposure--|
///               ^ start      ^ first row ^ end of frame        middle row        |--exposure--|
///                                                              last row                |--exposure--| end of frame
constexpr Span to_mid_exposure(StampPoint point, Shutter shutter, Span exposure, Span readout) noexcept {
  const Span from_start{exposure.ns / 2 + (shutter == Shutter::kRolling ? readout.ns / 2 : 0)};
  return to_start_of_exposure(point, exposure, readout) + from_start;
}

}  // namespace epiline
