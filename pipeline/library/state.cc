#include "pipeline/library/state.h"

#include <cstring>

namespace epiline {

namespace {
template <class T, std::size_t N>
void copy(const std::array<T, N>& from, void* to) noexcept {
  std::memcpy(to, from.data(), sizeof from);
}
}  // namespace

epiline_state state_of(const FrameOutcome& outcome) noexcept {
  const Odometry& o = outcome.odometry;
  epiline_state s{};
  s.image_ns = outcome.stamp.ns;
  s.stamp_ns = o.stamp.ns;
  copy(o.p_WB_m, s.position_m);
  copy(o.q_WB, s.orientation);
  copy(o.v_WB_m_s, s.velocity_m_s);
  copy(o.omega_B_rad_s, s.angular_velocity_rad_s);
  copy(o.accelerometer_bias_m_s2, s.accelerometer_bias_m_s2);
  copy(o.gyroscope_bias_rad_s, s.gyroscope_bias_rad_s);
  copy(o.imu_scale, s.imu_scale);
  s.time_offset_s = o.time_offset_s;
  static_assert(sizeof o.covariance == sizeof s.covariance);
  copy(o.covariance, s.covariance);
  s.has_pose = outcome.result.has_pose ? 1 : 0;
  s.health = static_cast<std::int32_t>(o.health.state);
  s.quality = o.health.quality;
  s.reasons = o.health.reasons;
  s.reset_counter = o.reset_counter;
  s.tracks = static_cast<std::uint32_t>(outcome.tracks);
  return s;
}

}  // namespace epiline
