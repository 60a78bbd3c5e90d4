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
  if (!state.is_open) return error("lost", "a line that stays");
  if (!state.peer.is_known) {
    if (state.counts.packets > 0)
      return error("MAVLink, but no autopilot's heartbeat", "one of the system that mavlink.system names");
    if (state.counts.skipped_bytes > 0) return error("bytes that are not MAVLink", "mavlink.baud as the peer has it");
    return error("nothing came", "a flight controller that speaks MAVLink, RX and TX crossed");
  }
  if (state.clock.used == 0) return error("no answer to TIMESYNC in 10 ms", "a quick line: a higher mavlink.baud");
  if (imu.refused_values > 0) return error("readings no IMU gives", "HIGHRES_IMU or RAW_IMU of both sensors");
  if (imu.refused_times > 0) return error("readings of another time", "their times on the clock of TIMESYNC");
  const char* const request =
      state.imu_request == mavlink::RequestState::kRefused ? "it refuses to send IMU readings" : "no IMU readings";
  return error(request, "HIGHRES_IMU, or RAW_IMU of an ArduPilot (set its stream rates by hand)");
}

}  // namespace

Status MavlinkImu::open() {
  constexpr std::int64_t kPatience_ns = 15'000'000'000;
  const std::int64_t until_ns = monotonic_ns() + kPatience_ns;
  while (link_.state().imu.readings == 0) {
    if (monotonic_ns() > until_ns) return missing(link_.state(), link_.name());
    ::usleep(10'000);
  }
  return Done{};
}

}  // namespace epiline
