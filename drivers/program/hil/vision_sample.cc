#include "drivers/program/hil/vision_sample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

namespace epiline::hil {

namespace {

// MAV_FRAME, MAV_ESTIMATOR_TYPE
constexpr int kLocalNed = 1, kLocalEnu = 4, kBodyFrd = 12, kLocalFrd = 20, kLocalFlu = 21;
constexpr int kNaive = 1, kVio = 3;
// Where ArduPilot caps the errors it makes of the covariance.
constexpr double kPositionErrorMost_m = 100, kAngleErrorMost_rad = 1.5;
constexpr double kVelocityErrorMost_m_s = 100;  // nothing flies so; there is no cap in the controllers

using Triangle = std::array<float, 21>;

bool is_local(int frame) {
  return frame == kLocalNed || frame == kLocalEnu || frame == kLocalFrd || frame == kLocalFlu;
}

bool are_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); });
}

/// ArduPilot's: cube root of the sum of the squared variances.
double error_of(const Triangle& c, std::size_t first) {
  double sum = 0;
  for (std::size_t i = first; i < first + 3; ++i) sum += std::pow(static_cast<double>(c[kDiagonal[i]]), 2);
  return std::cbrt(sum);
}

/// No pair of quantities is correlated by more than 1.
bool is_consistent(const Triangle& c) {
  constexpr double kRounding = 1e-4;
  std::size_t at = 0;
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i; j < 6; ++j, ++at)
      if (std::abs(c[at]) > (1 + kRounding) * std::sqrt(double{c[kDiagonal[i]]} * double{c[kDiagonal[j]]}) + 1e-12)
        return false;
  return true;
}

/// What is wrong with a covariance; empty: nothing.
std::string covariance_fault(const Triangle& c, double first_most, double second_most) {
  if (std::isnan(c[0])) return "unknown (NaN)";
  if (!are_finite(c)) return "not finite";
  for (const std::size_t d : kDiagonal)
    if (c[d] <= 0) return fmt::format("element {} of the triangle is {}", d, c[d]);
  if (error_of(c, 0) > first_most) return fmt::format("the first error is {:.3g}", error_of(c, 0));
  if (error_of(c, 3) > second_most) return fmt::format("the second error is {:.3g}", error_of(c, 3));
  if (!is_consistent(c)) return "correlations beyond 1";
  return "";
}

void judge_covariance(const char* of, const Triangle& c, double first_most, double second_most, HostStamp at,
                      RuleBook& book) {
  const std::string fault = covariance_fault(c, first_most, second_most);
  book.judge(Rule::kCovariance, fault.empty(), at, [&] { return std::string(of) + ": " + fault; });
}

Vec3 sigmas(const Triangle& c, std::size_t first) {
  Vec3 s;
  for (std::size_t i = 0; i < 3; ++i) {
    const double variance = c[kDiagonal[first + i]];
    s[static_cast<int>(i)] = variance > 0 ? std::sqrt(variance) : 0;  // NaN: not known
  }
  return s;
}

void judge_frames(const mavlink::Odometry& m, HostStamp at, RuleBook& book) {
  const auto text = [&] { return fmt::format("frame_id {}, child_frame_id {}", m.frame_id, m.child_frame_id); };
  book.judge(Rule::kFramesPx4, is_local(m.frame_id) && (is_local(m.child_frame_id) || m.child_frame_id == kBodyFrd), at,
             text);
  book.judge(Rule::kFramesArdupilot, m.frame_id == kLocalFrd && m.child_frame_id == kBodyFrd, at, text);
  book.judge(Rule::kEstimatorType, m.estimator_type <= kVio && m.estimator_type != kNaive, at,
             [&] { return fmt::format("estimator_type {}", m.estimator_type); });
}

void judge_quality(int quality, HostStamp at, RuleBook& book) {
  book.judge(Rule::kSilence, quality != -1, at, [] { return std::string("a message with quality -1 (failed)"); });
  book.judge(Rule::kQuality, quality == -1 || (quality >= 1 && quality <= 100), at,
             [&] { return fmt::format("quality {}", quality); });
}

bool is_unit(const Eigen::Quaterniond& q) { return std::abs(q.norm() - 1) < 1e-3; }

/// False: the stamp is no time at all, as what comes from outside may be any number.
bool judge_time(const char* field, std::uint64_t usec, HostStamp at, RuleBook& book) {
  const bool is_time = usec < std::uint64_t{1} << 51;
  if (!is_time) book.judge(Rule::kStamps, false, at, [&] { return fmt::format("{} {}", field, usec); });
  return is_time;
}

/// What both messages hold.
template <class Message>
VisionSample sample_of(const Message& m, std::uint64_t usec, const Triangle& covariance, HostStamp arrival) {
  VisionSample s;
  s.arrival = arrival;
  s.stamp.ns = static_cast<std::int64_t>(usec) * 1000;
  s.p_L = Vec3(m.x, m.y, m.z);
  s.sigma_p = sigmas(covariance, 0);
  s.sigma_angle = sigmas(covariance, 3);
  s.reset_counter = m.reset_counter;
  return s;
}

}  // namespace

TimedPose pose_of(const VisionSample& s, const Mat3& R_VB) {
  const Mat3 flip = Vec3(1, -1, -1).asDiagonal();
  const Mat3 R_WB = flip * s.q_LF.toRotationMatrix() * flip * R_VB;
  return {s.stamp, flip * s.p_L, Eigen::Quaterniond(R_WB)};
}

std::optional<VisionSample> judge_message(const mavlink::Odometry& m, HostStamp arrival, RuleBook& book) {
  judge_frames(m, arrival, book);
  judge_quality(m.quality, arrival, book);
  judge_covariance("pose", m.pose_covariance, kPositionErrorMost_m, kAngleErrorMost_rad, arrival, book);
  judge_covariance("velocity", m.velocity_covariance, kVelocityErrorMost_m_s, kVelocityErrorMost_m_s, arrival, book);
  const Eigen::Quaterniond q(m.q[0], m.q[1], m.q[2], m.q[3]);
  const std::array numbers = {m.x,  m.y,  m.z,  m.q[0],      m.q[1],       m.q[2],    m.q[3],
                              m.vx, m.vy, m.vz, m.rollspeed, m.pitchspeed, m.yawspeed};
  const bool usable = book.judge(Rule::kFinite, are_finite(numbers) && is_unit(q), arrival, [&] {
    return fmt::format("position ({}, {}, {}), velocity ({}, {}, {}), length of q {:.4f}", m.x, m.y, m.z, m.vx, m.vy,
                       m.vz, q.norm());
  });
  if (!judge_time("time_usec", m.time_usec, arrival, book) || !usable) return std::nullopt;
  VisionSample s = sample_of(m, m.time_usec, m.pose_covariance, arrival);
  s.q_LF = q.normalized();
  const Vec3 v(m.vx, m.vy, m.vz);
  s.v_L = is_local(m.child_frame_id) ? v : Vec3(s.q_LF * v);
  s.omega_F = Vec3(m.rollspeed, m.pitchspeed, m.yawspeed);
  s.sigma_v = sigmas(m.velocity_covariance, 0);
  s.is_north = m.frame_id == kLocalNed || m.frame_id == kLocalEnu;
  return s;
}

std::optional<VisionSample> judge_message(const mavlink::VisionPositionEstimate& m, HostStamp arrival, RuleBook& book) {
  judge_covariance("pose", m.covariance, kPositionErrorMost_m, kAngleErrorMost_rad, arrival, book);
  const std::array numbers = {m.x, m.y, m.z, m.roll, m.pitch, m.yaw};
  const bool usable = book.judge(Rule::kFinite, are_finite(numbers), arrival,
                                 [&] { return fmt::format("position ({}, {}, {})", m.x, m.y, m.z); });
  if (!judge_time("usec", m.usec, arrival, book) || !usable) return std::nullopt;
  VisionSample s = sample_of(m, m.usec, m.covariance, arrival);
  s.q_LF = Eigen::AngleAxisd(m.yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(m.pitch, Vec3::UnitY()) *
           Eigen::AngleAxisd(m.roll, Vec3::UnitX());
  s.is_north = true;
  return s;
}

}  // namespace epiline::hil
