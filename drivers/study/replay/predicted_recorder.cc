#include "drivers/study/replay/predicted_recorder.h"

#include <algorithm>

#include "estimator/geometry/so3.h"

namespace epiline {

bool PredictedRecorder::publish(const Odometry& o) noexcept {
  const bool room = count_ < rows_.size();
  if (room) rows_[count_++] = {o.stamp, o.p_WB_m, o.v_WB_m_s, o.omega_B_rad_s, o.q_WB, o.reset_counter};
  return (next_ == nullptr || next_->publish(o)) && room;
}

PredictedPath PredictedRecorder::path() const {
  PredictedPath path;
  for (std::size_t i = 0; i < count_; ++i) {
    const Row& row = rows_[i];
    const Eigen::Quaterniond q(row.q[0], row.q[1], row.q[2], row.q[3]);
    path.trajectory.poses.push_back({row.stamp, vec3(row.p), q});
    if (i == 0 || rows_[i - 1].resets != row.resets) continue;
    const Row& before = rows_[i - 1];
    const Eigen::Quaterniond q_before(before.q[0], before.q[1], before.q[2], before.q[3]);
    const double dt = (row.stamp - before.stamp).seconds();
    const Vec3 step = vec3(row.p) - vec3(before.p) - 0.5 * dt * (vec3(row.v) + vec3(before.v));
    const Mat3 turn = so3_exp(0.5 * dt * (vec3(row.omega) + vec3(before.omega)));
    const Vec3 turned = so3_log(turn.transpose() * (q_before.conjugate() * q).toRotationMatrix());
    path.largest_jump_m = std::max(path.largest_jump_m, step.norm());
    path.largest_jump_rad = std::max(path.largest_jump_rad, turned.norm());
    path.largest_jump_m_s = std::max(path.largest_jump_m_s, (vec3(row.v) - vec3(before.v)).norm());
  }
  return path;
}

}  // namespace epiline
