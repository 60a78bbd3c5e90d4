#pragma once
// The releases of flight controllers' programs that epiline knows, and in what they differ for odometry. One table for
// the link, `epiline check`, `epiline hil` and the guides: a new release is a new row. Pages:
// docs/flight-controller.md, docs/hil.md.
#include <array>
#include <cstddef>
#include <cstdint>

namespace epiline::mavlink {

inline constexpr std::uint8_t kArduPilot = 3, kPx4 = 12;  ///< MAV_AUTOPILOT

struct ControllerRelease {
  const char* option;         ///< as in `hil --judge`
  const char* name;           ///< for people
  std::uint8_t autopilot;     ///< MAV_AUTOPILOT
  std::uint16_t version = 0;  ///< 100 major + minor; 0: builds that no version tells apart
  /// Refuses to arm in Position mode without a heading, and takes none from LOCAL_FRD: PX4#26596, #26778, #27215 until
  /// #27371.
  bool arms_with_north_only = false;
  /// Takes EKF2_EVA_NOISE for a variance: PX4 ekf2 EKF2.cpp until #27342.
  bool squares_yaw_noise = false;
  /// Has EKF2_SENS_EN and ESTIMATOR_SENSOR_FUSION_STATUS: PX4#26739.
  bool has_sensor_switch = false;
  /// Keeps vision's position bias over the reset to a first origin, which throws the position away: PX4#26794.
  bool loses_position_at_origin = false;
  /// Fuses a satellite receiver beside ExternalNav: ArduPilot until #30076.
  bool fuses_gps_beside_vision = false;
};

inline constexpr auto kControllerReleases = std::to_array<ControllerRelease>({
    {.option = "px4-1.14", .name = "PX4 1.14", .autopilot = kPx4, .version = 114, .squares_yaw_noise = true},
    {.option = "px4-1.15", .name = "PX4 1.15", .autopilot = kPx4, .version = 115, .squares_yaw_noise = true},
    {.option = "px4-1.16", .name = "PX4 1.16", .autopilot = kPx4, .version = 116, .squares_yaw_noise = true},
    {.option = "px4-1.17", .name = "PX4 1.17", .autopilot = kPx4, .version = 117, .squares_yaw_noise = true},
    {.option = "px4-1.18",
     .name = "PX4 1.18",
     .autopilot = kPx4,
     .version = 118,
     .has_sensor_switch = true,
     .loses_position_at_origin = true},
    {.option = "px4-main",
     .name = "PX4 main",
     .autopilot = kPx4,
     .has_sensor_switch = true,
     .loses_position_at_origin = true},
    {.option = "px4-spring-2026",
     .name = "PX4 main of 27 February to 18 May 2026",
     .autopilot = kPx4,
     .arms_with_north_only = true,
     .squares_yaw_noise = true,
     .has_sensor_switch = true},
    {.option = "ardupilot-4.5",
     .name = "ArduPilot 4.5",
     .autopilot = kArduPilot,
     .version = 405,
     .fuses_gps_beside_vision = true},
    {.option = "ardupilot-4.6",
     .name = "ArduPilot 4.6",
     .autopilot = kArduPilot,
     .version = 406,
     .fuses_gps_beside_vision = true},
    {.option = "ardupilot-4.7", .name = "ArduPilot 4.7", .autopilot = kArduPilot, .version = 407},
});

/// A set of releases: bit i stands for kControllerReleases[i].
using Releases = unsigned;
template <class Is>
constexpr Releases releases_where(Is is) {
  Releases set = 0;
  for (std::size_t i = 0; i < kControllerReleases.size(); ++i)
    if (is(kControllerReleases[i])) set |= 1U << i;
  return set;
}

/// The release of that version, or the newest one if it is older; null: it is older than all, or not known (0).
constexpr const ControllerRelease* release_of(std::uint8_t autopilot, std::uint16_t version) {
  const ControllerRelease* found = nullptr;
  for (const ControllerRelease& r : kControllerReleases)
    if (r.autopilot == autopilot && r.version != 0 && r.version <= version) found = &r;
  return found;
}

}  // namespace epiline::mavlink
