#include "drivers/flights/simulate/motion_fit_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace epiline {
namespace {

bool finite(const std::array<double, 3>& a) {
  return std::all_of(a.begin(), a.end(), [](double x) { return std::isfinite(x); });
}

std::string seconds_text(HostStamp stamp) {
  return fmt::format("{}.{:09} s", stamp.ns / 1'000'000'000, std::abs(stamp.ns % 1'000'000'000));
}

/// Of the length of the truth's quaternions. Files with six decimals are off by 1e-6.
constexpr double kNormTolerance = 1e-3;

}  // namespace

Status check_readings(const std::vector<ImuSample>& imu, const std::string& imu_name) {
  const auto fail = [&](HostStamp at, const std::string& found, std::string expected) {
    return Error{ErrorKind::kUsage, imu_name, 0, "at " + seconds_text(at) + " " + found, std::move(expected)};
  };
  const double period = median_period(imu);
  for (std::size_t i = 0; i < imu.size(); ++i) {
    if (!finite(imu[i].angular_velocity_rad_s) || !finite(imu[i].specific_force_m_s2))
      return fail(imu[i].stamp, "a reading that is not finite", "six numbers");
    if (i == 0) continue;
    const double step = (imu[i].stamp - imu[i - 1].stamp).seconds();
    if (step <= 0) return fail(imu[i].stamp, "a reading out of order or doubled", "rising stamps");
    if (step > 5.5 * period)
      return fail(imu[i - 1].stamp, fmt::format("no reading for {:.3f} s", step),
                  fmt::format("one every {:.3f} s", period));
  }
  return Done{};
}

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
