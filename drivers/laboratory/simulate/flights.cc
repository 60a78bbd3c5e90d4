#include "drivers/laboratory/simulate/flights.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

/// Controls of the two splines of a flight, one pair for each knot.
struct Controls {
  double interval_s;
  double flight_s;
  std::vector<Vec3> position, euler;

  Controls(double interval, double flight) : interval_s(interval), flight_s(flight) {}
  int count() const { return static_cast<int>(flight_s / interval_s) + 6; }
  double time(int i) const { return (i - 1) * interval_s; }
  void push(const Vec3& p, const Vec3& e) {
    position.push_back(p);
    euler.push_back(e);
  }
  Flight finish(const Room& room) && {
    // The last pieces of the spline are left out: every flight ends in full motion.
    return {CubicSpline(interval_s, std::move(position)), CubicSpline(interval_s, std::move(euler)), flight_s - 0.6,
            room};
  }
};

/// A random walk of position and yaw, reflected at the sides of a box, with independent roll and pitch.
struct Wander {
  double step_m;
  Vec3 limit_m;
  double yaw_step_rad, tilt_rad;
  Vec3 position = Vec3::Zero(), euler = Vec3::Zero();

  void step(Random& random) {
    for (int k = 0; k < 3; ++k) {
      double& x = position[k];
      x += step_m * random.normal();
      if (x > limit_m[k]) x = 2 * limit_m[k] - x;
      if (x < -limit_m[k]) x = -2 * limit_m[k] - x;
    }
    euler.z() += yaw_step_rad * random.normal();
    for (int k = 0; k < 2; ++k) euler[k] = tilt_rad * random.normal();
  }
};

Flight make_wandering(double interval_s, double flight_s, Wander wander, const Room& room, Random& random) {
  Controls controls(interval_s, flight_s);
  wander.euler.z() = random.uniform(-3, 3);
  for (int i = 0; i < controls.count(); ++i) {
    wander.step(random);
    controls.push(wander.position, wander.euler);
  }
  return std::move(controls).finish(room);
}

/// Where the body is in the calm middle of a flight, relative to where the middle began.
struct CalmOffset {
  Vec3 position = Vec3::Zero(), euler = Vec3::Zero();

  void step(FlightKind kind, double calm_s, Random& random) {
    if (kind == FlightKind::kHover) {
      for (int k = 0; k < 3; ++k) {
        position[k] = 0.9 * position[k] + 0.012 * random.normal();
        euler[k] = 0.9 * euler[k] + 0.006 * random.normal();
      }
    } else if (kind == FlightKind::kPureRotation) {
      euler = Vec3(0.15 * std::sin(1.1 * calm_s), 0.2 * std::sin(0.9 * calm_s), 1.2 * std::sin(0.55 * calm_s));
    }
  }
};

/// Eight seconds of flight, `calm_s` of something calmer, eight seconds of flight.
Flight make_interrupted(FlightKind kind, double calm_s, Random& random) {
  constexpr double kBefore_s = 8, kAfter_s = 8;
  Controls controls(0.5, kBefore_s + calm_s + kAfter_s);
  Wander wander{.step_m = 0.45, .limit_m = {2, 2, 0.8}, .yaw_step_rad = 0.25, .tilt_rad = 0.12};
  wander.euler.z() = random.uniform(-3, 3);
  CalmOffset offset;
  for (int i = 0; i < controls.count(); ++i) {
    const double t = controls.time(i) - kBefore_s;
    if (t < 0 || t >= calm_s) {
      wander.step(random);
      controls.push(wander.position, wander.euler);
    } else {
      wander.euler.head<2>().setZero();  // level: a hovering body does not lean
      offset.step(kind, t, random);
      controls.push(wander.position + offset.position, wander.euler + offset.euler);
    }
  }
  return std::move(controls).finish(Room{});
}

Flight make_straight(Random& random) {
  constexpr double kShaken_s = 6, kSpeed_m_s = 1.5;
  Controls controls(0.5, 50);
  double x = 0;
  for (int i = 0; i < controls.count(); ++i) {
    const double t = controls.time(i);
    Vec3 position(x, 0, 0), euler(0, 0, std::numbers::pi / 2);
    if (t < kShaken_s) {
      position += random.normal3(1).cwiseProduct(Vec3(0.3, 0.3, 0.2));
      euler += random.normal3(1).cwiseProduct(Vec3(0.05, 0.05, 0.1));
    }
    controls.push(position, euler);
    x += controls.interval_s * kSpeed_m_s * std::clamp((t - 2) / 4, 0.0, 1.0);
  }
  return std::move(controls).finish(Room{.low = {-20, -6, -3}, .high = {100, 6, 5}});
}

Flight make_corridor(Random& random) {
  constexpr double kShaken_s = 5, kSpeed_m_s = 1.3;
  Controls controls(0.5, 50);
  const double phase = random.uniform(-3, 3);
  double x = 0;
  for (int i = 0; i < controls.count(); ++i) {
    const double t = controls.time(i);
    const bool shaken = t < kShaken_s;
    Vec3 position(x, 0.08 * std::sin(0.5 * t + phase), 0);
    position.y() += (shaken ? 0.15 : 0.01) * random.normal();
    position.z() += (shaken ? std::hypot(0.02, 0.1) : 0.02) * random.normal();
    Vec3 euler = random.normal3(1).cwiseProduct(Vec3(0.01, 0.015, 0.01));
    euler.z() += 0.05 * std::sin(0.4 * t + phase);
    controls.push(position, euler);
    x += controls.interval_s * kSpeed_m_s * std::clamp(t / 3, 0.0, 1.0);
  }
  return std::move(controls).finish(Room{.low = {-5, -1.3, -1.2}, .high = {90, 1.3, 1.8}, .nearest_share = 0.75});
}

Flight make_standstill(Random& random) {
  // A control is felt less than two intervals before and after its time: what is to rest until t has the same controls
  // until t + 0.5, what is to rest from t on, from t - 0.5 on.
  constexpr double kTakeOff_s = 5, kFlying_s = 8, kApproach_s = 34, kLanded_s = 40, kEnd_s = 45, kHeight_m = 1.2;
  Controls controls(0.5, kEnd_s + 0.6);
  Wander wander{.step_m = 0.4, .limit_m = {2, 2, 0.4}, .yaw_step_rad = 0.25, .tilt_rad = 0.1};
  const Vec3 on_ground(random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-3, 3));
  wander.euler = on_ground;
  double height = 0;
  for (int i = 0; i < controls.count(); ++i) {
    const double t = controls.time(i);
    if (t >= kFlying_s && t < kApproach_s) {
      wander.step(random);
      height = kHeight_m;
    } else if (t < kFlying_s) {
      height = kHeight_m * std::clamp((t - kTakeOff_s - 0.5) / (kFlying_s - kTakeOff_s - 0.5), 0.0, 1.0);
    } else {
      wander.euler.head<2>() = on_ground.head<2>();
      const double left = std::clamp((kLanded_s - 0.5 - t) / (kLanded_s - 0.5 - kApproach_s), 0.0, 1.0);
      height = left * (kHeight_m + wander.position.z()) - wander.position.z();
    }
    controls.push(wander.position + Vec3(0, 0, height), wander.euler);
  }
  return std::move(controls).finish(Room{.low = {-5, -5, -0.3}, .high = {5, 5, 4}});
}

/// From 0 to 1 with two continuous derivatives; the steepest slope is 1.875.
double smooth_step(double u) {
  const double x = std::clamp(u, 0.0, 1.0);
  return x * x * x * (10 + x * (6 * x - 15));
}

/// A cart that turns about its middle and drives the way it looks. Time goes on in small steps.
class Cart {
 public:
  explicit Cart(Random& random) : random_(random), yaw_(random.uniform(-3, 3)) {
    for (Wave& wave : ground_) {
      wave = {.per_metre = 2 * std::numbers::pi / random.uniform(0.25, 2), .phases = {}};
      for (double& phase : wave.phases) phase = random.uniform(-3, 3);
    }
  }
  void advance(double dt) {
    t_ += dt;
    if (t_ > end_) next_manoeuvre();
    double speed = 0;
    if (distance_ > 0) {
      // up to speed, along, and down to rest; bent by a heading that goes out and back
      const double since = t_ - begin_, left = end_ - t_;
      speed = kSpeed_m_s * smooth_step(since / kSpeeding_s) * smooth_step(left / kSpeeding_s);
      driven_ += speed * dt;
      const double swing = std::sin(std::numbers::pi * std::clamp(driven_ / distance_, 0.0, 1.0));
      yaw_ = yaw_begin_ + bend_rad_ * swing * swing;
    } else {
      yaw_ = yaw_begin_ + turn_rad_ * smooth_step((t_ - begin_) / (end_ - begin_));
    }
    path_ += speed * dt;
    p_ += speed * dt * Vec3(std::cos(yaw_), std::sin(yaw_), 0);
  }
  /// Uneven ground: a matter of the path, so that it rests when the cart rests.
  Vec3 position() const { return p_ + Vec3(0, 0, 1e-3 * rough(0)); }
  Vec3 euler() const { return {2e-3 * rough(1), 2e-3 * rough(2), yaw_}; }

 private:
  static constexpr double kSpeed_m_s = 0.8, kSpeeding_s = 1.5, kTurnRate_rad_s = 1.2, kBox_m = 3;
  struct Wave {
    double per_metre;
    std::array<double, 3> phases;
  };

  double rough(std::size_t what) const {
    double sum = 0;
    for (const Wave& wave : ground_) sum += std::sin(wave.per_metre * path_ + wave.phases[what]);
    return sum / std::sqrt(0.5 * static_cast<double>(ground_.size()));  // rms 1
  }

  void next_manoeuvre() {
    constexpr std::array kOrder{Manoeuvre::kRest, Manoeuvre::kTurn, Manoeuvre::kDrive};
    begin_ = end_;
    yaw_begin_ = yaw_;
    distance_ = turn_rad_ = driven_ = 0;
    switch (kOrder[next_++ % kOrder.size()]) {
      case Manoeuvre::kRest:
        end_ = begin_ + random_.uniform(1, 2.5);
        break;
      case Manoeuvre::kTurn: {
        do {
          goal_ = Vec3(random_.uniform(-kBox_m, kBox_m), random_.uniform(-kBox_m, kBox_m), 0);
        } while ((goal_ - p_).norm() < kLeast_m);
        turn_rad_ = std::remainder(std::atan2(goal_.y() - p_.y(), goal_.x() - p_.x()) - yaw_, 2 * std::numbers::pi);
        end_ = begin_ + std::max(0.8, 1.875 * std::abs(turn_rad_) / kTurnRate_rad_s);
        break;
      }
      case Manoeuvre::kDrive:
        distance_ = (goal_ - p_).norm();
        bend_rad_ = random_.uniform(-0.4, 0.4);
        end_ = begin_ + distance_ / kSpeed_m_s + kSpeeding_s;
        break;
    }
  }

  enum class Manoeuvre { kRest, kTurn, kDrive };
  static constexpr double kLeast_m = 2.5;
  Random& random_;
  std::array<Wave, 6> ground_{};
  double t_ = 0, begin_ = 0, end_ = 0, path_ = 0;
  double yaw_, yaw_begin_ = 0, turn_rad_ = 0;
  double distance_ = 0, driven_ = 0, bend_rad_ = 0;
  Vec3 p_ = Vec3::Zero(), goal_ = Vec3::Zero();
  std::size_t next_ = 0;
};

Flight make_rover(Random& random) {
  constexpr int kSteps = 50;
  Controls controls(0.05, 60.6);
  Cart cart(random);
  for (int i = 0; i < controls.count(); ++i) {
    controls.push(cart.position(), cart.euler());
    for (int k = 0; k < kSteps; ++k) cart.advance(controls.interval_s / kSteps);
  }
  return std::move(controls).finish(Room{.low = {-5, -5, -0.4}, .high = {5, 5, 2.6}});
}

/// In gusts, which push and tilt it, and move its height slowly.
Flight make_survey(double height_m, Random& random) {
  constexpr double kTakeOff_s = 5, kClimb_m_s = 3, kUpToSpeed_s = 6, kSpeed_m_s = 12, kLeg_m = 1000, kLead_s = 4;
  const double climb_s = height_m / kClimb_m_s + kUpToSpeed_s, level_s = kTakeOff_s + climb_s + 2;
  Controls controls(0.5, level_s + kLead_s + kLeg_m / kSpeed_m_s + kUpToSpeed_s);
  double x = 0, height = 0, wander = 0;
  const double yaw = random.uniform(-0.3, 0.3);
  for (int i = 0; i < controls.count(); ++i) {
    const double t = controls.time(i), climbing = t - kTakeOff_s, flying = t - level_s;
    Vec3 position(x, 0, height), euler(0, 0, yaw);
    if (climbing > 0) {
      wander = 0.97 * wander + 0.08 * random.normal();
      const double wind = std::min(1.0, climbing / 6);
      position += wind * (random.normal3(0.03) + Vec3(0, 0, wander));
      euler += wind * random.normal3(1).cwiseProduct(Vec3(0.02, 0.02, 0.02));
    }
    controls.push(position, euler);
    // as fast as it may be, and no faster than to come to rest at its height
    const double left = std::max(0.0, height_m - height);
    height += controls.interval_s * kClimb_m_s * smooth_step(climbing / kUpToSpeed_s) * std::min(1.0, left / 6);
    x += controls.interval_s * kSpeed_m_s * smooth_step(flying / kUpToSpeed_s);
  }
  return std::move(controls).finish(
      Room{.low = {-500, -1000, kSurveyGround_m}, .high = {2000, 1000, height_m + 100}, .nearest_share = 1});
}

constexpr std::array<const char*, kAllFlights.size()> kNames{"agile",    "hall",    "hover",      "still", "straight",
                                                             "corridor", "purerot", "standstill", "rover", "survey"};

}  // namespace

const char* to_string(FlightKind kind) { return kNames[static_cast<std::size_t>(kind)]; }

std::optional<FlightKind> flight_from(std::string_view name) {
  for (const FlightKind kind : kAllFlights)
    if (name == to_string(kind)) return kind;
  return std::nullopt;
}

Flight::Flight(CubicSpline position_m, CubicSpline euler_rad, double duration_s, const Room& room)
    : position_(std::move(position_m)), euler_(std::move(euler_rad)), duration_s_(duration_s), room_(room) {}

Motion Flight::at(double t_s) const {
  const CubicSpline::Value p = position_.at(t_s), e = euler_.at(t_s);
  const Mat3 R_x = so3_exp(Vec3(e.value.x(), 0, 0)), R_y = so3_exp(Vec3(0, e.value.y(), 0));
  Motion m;
  m.p_WB = p.value;
  m.v_WB = p.first;
  m.a_WB = p.second;
  m.R_WB = so3_exp(Vec3(0, 0, e.value.z())) * R_y * R_x;
  // Each Euler rate turns about its own axis, which the rotations after it carry along.
  m.omega_B =
      Vec3(e.first.x(), 0, 0) + R_x.transpose() * (Vec3(0, e.first.y(), 0) + R_y.transpose() * Vec3(0, 0, e.first.z()));
  return m;
}

Flight make_flight(FlightKind kind, Random& random, double height_m) {
  switch (kind) {
    case FlightKind::kAgile:
      return make_wandering(0.5, 40, {.step_m = 0.9, .limit_m = {2.5, 2.5, 1}, .yaw_step_rad = 0.5, .tilt_rad = 0.25},
                            Room{}, random);
    case FlightKind::kHall:
      return make_wandering(1.0, 60, {.step_m = 1.0, .limit_m = {8, 5, 1.5}, .yaw_step_rad = 0.3, .tilt_rad = 0.1},
                            Room{.low = {-14, -9, -3}, .high = {14, 9, 6}}, random);
    case FlightKind::kHover:
      return make_interrupted(kind, 60, random);
    case FlightKind::kStill:
      return make_interrupted(kind, 40, random);
    case FlightKind::kPureRotation:
      return make_interrupted(kind, 20, random);
    case FlightKind::kStraight:
      return make_straight(random);
    case FlightKind::kCorridor:
      return make_corridor(random);
    case FlightKind::kStandstill:
      return make_standstill(random);
    case FlightKind::kSurvey:
      return make_survey(height_m, random);
    case FlightKind::kRover:
      return make_rover(random);
  }
  return {};
}

}  // namespace epiline
