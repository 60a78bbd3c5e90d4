#pragma once
// Built-in flights: position and Euler angles are cubic B-splines, so velocity, acceleration and angular rate have
// closed forms.
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/flights/motion/motion.h"
#include "drivers/flights/motion/random.h"
#include "drivers/flights/motion/spline.h"
#include "estimator/geometry/types.h"

namespace epiline {

enum class FlightKind : std::uint8_t {
  kAgile,         ///< about 2 m/s with turns in a room
  kHall,          ///< the same, slower, in a hall
  kHover,         ///< flight, a minute of hovering with a few centimetres of slow drift, flight
  kStill,         ///< flight, 40 s exactly at rest, flight
  kStraight,      ///< shaken for 6 s, then at constant speed, the camera looking sideways
  kCorridor,      ///< forward through a narrow corridor
  kPureRotation,  ///< flight, 20 s of rotation about the IMU, flight
  kStandstill,    ///< 5 s exactly at rest, take-off, flight, landing, 5 s exactly at rest
  kRover,         ///< on wheels: forward and along gentle bends, stops, turns in place; begins at rest
  kSurvey,        ///< rest, climb to a height, 1 km straight ahead at 12 m/s; the camera looks down
};
inline constexpr std::array kAllFlights{FlightKind::kAgile,        FlightKind::kHall,       FlightKind::kHover,
                                        FlightKind::kStill,        FlightKind::kStraight,   FlightKind::kCorridor,
                                        FlightKind::kPureRotation, FlightKind::kStandstill, FlightKind::kRover,
                                        FlightKind::kSurvey};
const char* to_string(FlightKind kind);
std::optional<FlightKind> flight_from(std::string_view name);

/// The box the flight takes place in, and how its walls are furnished.
struct Room {
  Vec3 low{-5, -5, -1.5}, high{5, 5, 3};  ///< corners in W, m
  double nearest_share = 0.4;             ///< objects lie between this share of the distance to the wall and the wall
};

class Flight final : public MotionModel {
 public:
  Flight() = default;
  /// `euler_rad`: roll, pitch, yaw; R_WB = R_z(yaw) R_y(pitch) R_x(roll).
  Flight(CubicSpline position_m, CubicSpline euler_rad, double duration_s, const Room& room);
  /// `t_s` in [0, duration_s()].
  Motion at(double t_s) const override;
  double duration_s() const override { return duration_s_; }
  const Room& room() const { return room_; }

 private:
  CubicSpline position_, euler_;
  double duration_s_ = 0;
  Room room_;
};

inline constexpr double kUsualHeight_m = 100;
/// Where the ground of a survey lies; the body begins at height 0.
inline constexpr double kSurveyGround_m = -0.4;

/// A random flight of that kind. `height_m`: of a survey.
Flight make_flight(FlightKind kind, Random& random, double height_m = kUsualHeight_m);
/// Whether its camera looks down, not ahead.
constexpr bool looks_down(FlightKind kind) { return kind == FlightKind::kSurvey; }

}  // namespace epiline
