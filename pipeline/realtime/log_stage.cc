#include "pipeline/realtime/log_stage.h"

#include <algorithm>
#include <limits>

namespace epiline {

bool LogStage::over() const noexcept {
  return std::all_of(in_.writers_ended.begin(), in_.writers_ended.end(), [](const EndMark* m) { return m->is_set(); });
}

Step LogStage::step() noexcept {
  const bool last = over();  // before the look at the rings: what came before the end is found
  const std::int64_t now_ns = clock_.now_ns();
  const HostStamp now = clock_.pace->stamp_of(now_ns), end_of_time{std::numeric_limits<std::int64_t>::max()};
  for (const auto& [name, ring] : in_.imu) in_.log.note_lost(name, ring->dropped(), now);
  in_.log.note_lost(RingName::kWheelToEstimate, in_.speeds.dropped(), now);
  in_.log.note_lost(RingName::kHeightToEstimate, in_.heights.dropped(), now);
  in_.log.drain(now, last ? end_of_time : clock_.pace->stamp_of(now_ns - FlightLog::kEventWindow.ns), in_.images);
  return last ? Step::end() : Step::nothing_until(now_ns + kIdle.ns);
}

}  // namespace epiline
