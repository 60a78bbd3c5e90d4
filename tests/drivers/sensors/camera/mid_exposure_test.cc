#include "drivers/sensors/camera/mid_exposure.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace epiline {
namespace {

// A sensor played row by row: where its stamps and its middle are, whatever the formula says.
RC_GTEST_PROP(MidExposure, IsTheMiddleOfAPlayedSensor, ()) {
  const auto shutter = *rc::gen::element(Shutter::kGlobal, Shutter::kRolling);
  const std::int64_t begin = *rc::gen::inRange<std::int64_t>(0, 1'000'000'000'000);
  const std::int64_t exposure = 2 * *rc::gen::inRange<std::int64_t>(0, 20'000'000);
  const std::int64_t row = 2 * *rc::gen::inRange<std::int64_t>(0, 30'000);
  const int rows = 481;  // row 240 is the middle one
  std::int64_t first_arrived = 0, arrived = 0, middle = 0;
  for (int r = 0; r < rows; ++r) {
    const std::int64_t exposed_from = begin + (shutter == Shutter::kRolling ? r * row : 0);
    const std::int64_t read_at = begin + exposure + r * row;  // one row after the other, in either
    if (r == 240) middle = exposed_from + exposure / 2;
    if (r == 0) first_arrived = read_at;
    arrived = read_at;
  }
  const Span readout{(rows - 1) * row};
  const HostStamp start{begin}, end{arrived}, first_row{first_arrived};
  for (const auto& [point, stamp] :
       {std::pair{StampPoint::kFirstRow, first_row}, std::pair{StampPoint::kEndOfFrame, end},
        std::pair{StampPoint::kStartOfExposure, start}}) {
    RC_ASSERT(stamp + to_start_of_exposure(point, Span{exposure}, readout) == start);
    RC_ASSERT((stamp + to_mid_exposure(point, shutter, Span{exposure}, readout)).ns == middle);
  }
}

}  // namespace
}  // namespace epiline
