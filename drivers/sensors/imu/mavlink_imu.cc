#include "drivers/sensors/imu/mavlink_imu.h"

#include <unistd.h>

#include <string>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

/// Why there is no reading yet: the first thing that is missing.
Error missing(const mavlink::LinkState& state, const std::string& line) {
  const auto error = [&](const std::string& found, const char* expected) {
    return Error{ErrorKind::kRun, line, 0, found, expected};
  };
  const mavlink::ControllerImuCounts& imu = state.imu;
  if (!state.is_open) return error("the line was lost", "a line that stays connected");
  if (!state.peer.is_known) {
    if (state.counts.packets > 0)
      return error("MAVLink arrives, but no heartbeat of an autopilot", "one with the system id of mavlink.system");
    if (state.counts.skipped_bytes > 0)
      return error("bytes arrive that are not MAVLink", "the baud rate of the flight controller in mavlink.baud");
    return error("no bytes arrived",
                 "a flight controller that sends MAVLink on this port, with RX and TX crossed; over UDP, from the very "
                 "ADDRESS:PORT of "
                 "mavlink.udp");
  }
  if (state.clock.used == 0)
    return error("no answer to TIMESYNC within 10 ms", "a faster line: a higher mavlink.baud, or USB");
  if (imu.refused_values > 0)
    return error("the IMU samples have impossible values", "HIGHRES_IMU or RAW_IMU with both sensors");
  if (imu.refused_times > 0)
    return error("the IMU samples have wrong times", "times on the clock that answers TIMESYNC");
  const char* const request = state.imu_request == mavlink::RequestState::kRefused
                                  ? "the flight controller refuses to send IMU samples"
                                  : "no IMU samples arrived";
  return error(request, "HIGHRES_IMU, or RAW_IMU from ArduPilot (set its stream rate there)");
}

}  // namespace

Status MavlinkImu::open() {
  constexpr std::int64_t kPatience_ns = 15'000'000'000;
  const std::int64_t until_ns = monotonic_ns() + kPatience_ns;
  while (link_.state().imu.readings == 0) {
    if (monotonic_ns() > until_ns || gives_up_.load(std::memory_order_relaxed))
      return missing(link_.state(), link_.name());
    ::usleep(10'000);
  }
  return Done{};
}

}  // namespace epiline
