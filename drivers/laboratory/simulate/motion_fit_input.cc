#include "drivers/laboratory/simulate/motion_fit_input.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace epiline {
namespace {

/// Of the length of the truth's quaternions. Files with six decimals are off by 1e-6.
constexpr double kNormTolerance = 1e-3;

}  // namespace

Result<std::vector<TimedPose>> usable_poses(const std::vector<ImuSample>& imu, const Trajectory& truth,
                                            const FitSettings& settings) {
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, settings.truth_name, 0, std::move(found), std::move(expected)};
  };
  const auto no_rotation = [&](HostStamp at) {
    return fail("at " + seconds_text(at) + " no position or no unit quaternion", "finite numbers, |q| = 1");
  };
  if (truth.worst_norm_error > kNormTolerance) return no_rotation(truth.worst_norm_at);
  std::vector<TimedPose> poses;
  for (const TimedPose& pose : truth.poses)
    if (!imu.empty() && pose.stamp >= imu.front().stamp && pose.stamp <= imu.back().stamp) poses.push_back(pose);
  const double covered = poses.empty() ? 0 : (poses.back().stamp - poses.front().stamp).seconds();
  if (covered < settings.shortest_s) {
    return fail(fmt::format("{:.3f} s in common with {}", covered, settings.imu_name),
                fmt::format("{:.3f} s at least", settings.shortest_s));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double norm = poses[i].q_WB.norm();
    if (!poses[i].p_WB.allFinite() || !(std::abs(norm - 1) < kNormTolerance)) return no_rotation(poses[i].stamp);
    if (i == 0) continue;
    const double gap = (poses[i].stamp - poses[i - 1].stamp).seconds();
    if (gap > settings.longest_gap_s) {
      return fail(fmt::format("at {} no pose for {:.3f} s", seconds_text(poses[i - 1].stamp), gap),
                  fmt::format("gaps up to {} s", settings.longest_gap_s));
    }
  }
  return poses;
}

std::vector<ImuSample> within(const std::vector<ImuSample>& imu, const std::vector<TimedPose>& poses) {
  std::vector<ImuSample> inside;
  for (const ImuSample& s : imu)
    if (s.stamp >= poses.front().stamp && s.stamp <= poses.back().stamp) inside.push_back(s);
  return inside;
}

}  // namespace epiline
