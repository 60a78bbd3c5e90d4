#pragma once
#include <array>
#include <cstdint>

#include "pipeline/stages/back_end.h"

namespace epiline {

/// What the estimator knows after an image; plain data, it travels through rings. An image is tracked with the
/// knowledge from after the image before the previous one, so that it can be tracked while the previous one is still
/// being estimated. The first two images have what is known before any image.
struct Knowledge {
  std::array<double, 3> gyroscope_bias_rad_s{};
  double time_offset_s = 0;                ///< t_IMU - t_image, as handed out
  Span imu_after_image{};                  ///< the tracker needs readings up to the image's stamp and this
  HostStamp stamp{};                       ///< of the velocity, on the IMU's clock
  std::array<double, 3> velocity_B_m_s{};  ///< zero: not known
};

/// How many images later than the one it comes from knowledge is used.
inline constexpr std::uint64_t kKnowledgeDelay = 2;

inline Knowledge knowledge_of(const BackEnd& back_end) noexcept {
  const HostStamp zero{};
  const Vec3 bias = back_end.estimator().gyroscope_bias();
  const Odometry& o = back_end.estimator().odometry();
  Knowledge known{{bias.x(), bias.y(), bias.z()}, o.time_offset_s, back_end.imu_needed_until(zero) - zero, {}, {}};
  if (o.health.state != HealthState::kTracking && o.health.state != HealthState::kDegraded) return known;
  known.stamp = o.stamp;
  const Eigen::Quaterniond q_WB(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]);
  Eigen::Map<Vec3>(known.velocity_B_m_s.data()) = q_WB.conjugate() * Vec3(o.v_WB_m_s.data());
  return known;
}

}  // namespace epiline
