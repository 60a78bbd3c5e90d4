#pragma once
// A companion computer in front of the controller's model, whose habits a test may spoil.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "drivers/program/hil/controller_model.h"

namespace epiline::hil {

constexpr double kRadius_m = 5, kTurn_rad_s = 0.4, kClimb_m_s = 0.3;
constexpr HostStamp kBegin{5'000'000'000'000};

/// A vehicle on a spiral to the left, its nose along the path.
struct Spiral {
  double angle, height;
  explicit Spiral(HostStamp t)
      : angle(kTurn_rad_s * (t - kBegin).seconds()), height(kClimb_m_s * (t - kBegin).seconds()) {}
};

inline Eigen::Quaternionf about_z(double angle) {
  return Eigen::Quaternionf(Eigen::AngleAxisf(static_cast<float>(angle), Eigen::Vector3f::UnitZ()));
}

inline void set_diagonals(std::array<float, 21>& c, float first, float second) {
  c = {};
  c[0] = c[6] = c[11] = first;
  c[15] = c[18] = c[20] = second;
}

/// What it is to be told, written down by hand: forward, right, down.
inline mavlink::Odometry odometry_at(HostStamp t) {
  const Spiral s(t);
  mavlink::Odometry m;
  m.time_usec = static_cast<std::uint64_t>(t.ns / 1000);
  m.x = static_cast<float>(kRadius_m * std::cos(s.angle));
  m.y = static_cast<float>(-kRadius_m * std::sin(s.angle));
  m.z = static_cast<float>(-s.height);
  const Eigen::Quaternionf q = about_z(-(s.angle + std::numbers::pi / 2));
  m.q = {q.w(), q.x(), q.y(), q.z()};
  m.vx = static_cast<float>(kRadius_m * kTurn_rad_s);
  m.vz = static_cast<float>(-kClimb_m_s);
  m.yawspeed = static_cast<float>(-kTurn_rad_s);
  set_diagonals(m.pose_covariance, 1e-4F, 1e-4F);
  set_diagonals(m.velocity_covariance, 1e-4F, 1e-6F);
  m.quality = 80;
  return m;
}

/// The same in a world that is turned and shifted.
inline std::optional<TruthState> spiral_truth_at(HostStamp t) {
  const Spiral s(t);
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3::UnitZ()).toRotationMatrix();
  TruthState truth;
  truth.p_WB = turn * Vec3(kRadius_m * std::cos(s.angle), kRadius_m * std::sin(s.angle), s.height) + Vec3(10, -20, 3);
  const double speed = kRadius_m * kTurn_rad_s;
  truth.v_WB = turn * Vec3(-speed * std::sin(s.angle), speed * std::cos(s.angle), kClimb_m_s);
  truth.R_WB = turn * Eigen::AngleAxisd(s.angle + std::numbers::pi / 2, Vec3::UnitZ()).toRotationMatrix();
  return truth;
}

template <class Message>
std::pair<double, mavlink::Packet> at(double t, const Message& message) {
  return {t, mavlink::pack(message, mavlink::Address{}, 0)};
}
inline std::pair<double, mavlink::Packet> text_at(double t, const std::string& text) {
  mavlink::StatusText m;
  std::copy(text.begin(), text.end(), m.text.begin());
  return at(t, m);
}

/// A companion computer, whose habits a test may spoil. Times in seconds since the begin.
struct Companion {
  double duration_s = 8;
  double rate_hz = 40;
  double latency_s = 0.004;  ///< from a stamp to the arrival
  double answer_s = 0.001;   ///< until a TIMESYNC is answered; negative: never
  double heartbeat_s = 1;    ///< interval
  double clock_jump_s = 0;   ///< of the clock that answers show, half-way
  mavlink::Address address;
  mavlink::Heartbeat heartbeat{.system_status = 4};
  std::function<void(mavlink::Odometry&, double t)> spoil = [](mavlink::Odometry&, double) {};
  std::function<bool(double t)> sends = [](double) { return true; };
  std::deque<std::pair<double, mavlink::Packet>> more;  ///< in time order, numbered when they are sent
  bool skip_a_number = false;
};

class Bench {
 public:
  Bench(const Companion& companion, ControllerSettings settings)
      : companion_(companion), model_(settings, spiral_truth_at) {}

  Verdict run() {
    const auto steps = static_cast<int>(companion_.duration_s * 1000);
    for (int ms = 0; ms < steps; ++ms) step(1e-3 * ms);
    return model_.finish(kBegin + Span::from_seconds(companion_.duration_s));
  }
  const ControllerModel& model() const { return model_; }

 private:
  void send(mavlink::Packet packet, HostStamp now) {
    if (companion_.skip_a_number && sequence_ == 100) ++sequence_;
    packet.from = companion_.address;
    packet.sequence = sequence_++;
    model_.receive(packet, now);
  }

  void send_due(std::deque<std::pair<double, mavlink::Packet>>& packets, double t, HostStamp now) {
    for (; !packets.empty() && t >= packets.front().first; packets.pop_front()) send(packets.front().second, now);
  }

  void step(double t) {
    const HostStamp now = kBegin + Span::from_seconds(t);
    if (t >= next_heartbeat_) {
      next_heartbeat_ += companion_.heartbeat_s;
      send(at(t, companion_.heartbeat).second, now);
    }
    send_due(companion_.more, t, now);
    if (t >= next_odometry_) {
      next_odometry_ += 1 / companion_.rate_hz;
      mavlink::Odometry m = odometry_at(now - Span::from_seconds(companion_.latency_s));
      companion_.spoil(m, t);
      if (companion_.sends(t)) send(at(t, m).second, now);
    }
    send_due(answers_, t, now);
    while (const mavlink::Packet* packet = model_.next(now)) hear(*packet, now, t);
  }

  void hear(const mavlink::Packet& packet, HostStamp now, double t) {
    mavlink::Timesync m;
    if (!mavlink::unpack(packet, m) || m.tc1 != 0 || companion_.answer_s < 0) return;
    const double jump = t > 0.5 * companion_.duration_s ? companion_.clock_jump_s : 0;
    m.tc1 = (now + Span::from_seconds(0.5 * companion_.answer_s + jump)).ns;
    answers_.push_back(at(t + companion_.answer_s, m));
  }

  Companion companion_;
  ControllerModel model_;
  std::deque<std::pair<double, mavlink::Packet>> answers_;
  double next_heartbeat_ = 0.1, next_odometry_ = 0.2;
  std::uint8_t sequence_ = 0;
};

inline ControllerSettings settings() {
  ControllerSettings s;
  s.skew_ppm = 40;
  s.timesync_hz = 100;  // converges within 6 s
  return s;
}

}  // namespace epiline::hil
